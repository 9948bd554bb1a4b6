"""What the index of packages is told of the project's address, from its one place: [tool.nrdob]."""

import re
import tomllib
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class Address(MetadataHookInterface):
    """Writes the address where there is one, and leads the relative links of the README there."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add it to the metadata of the project."""
        root = Path(self.root)
        settings = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))
        text = (root / "README.md").read_text("utf-8")
        metadata["urls"] = {}
        # As it is copied from the page or for git; book/ext/getting.py takes it likewise.
        if address := settings["tool"]["nrdob"]["repository"].rstrip("/").removesuffix(".git"):
            metadata["urls"] = {"Source": address}
            text = re.sub(r"\]\((?!\w+:|#)", f"]({address}/blob/main/", text)
            text = re.sub(r'src="(?!\w+:)', f'src="{address}/raw/main/', text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
