"""The project's address in the metadata of wheel and sdist, from its one place: [tool.nrdob]."""

import tomllib
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


class Address(MetadataHookInterface):
    """Writes the address where there is one."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add it to the metadata of the project."""
        settings = tomllib.loads(Path(self.root, "pyproject.toml").read_text("utf-8"))
        address = settings["tool"]["nrdob"]["repository"]
        metadata["urls"] = {"Source": address} if address else {}
