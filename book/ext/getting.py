"""From every page to a copy that runs: what can be downloaded, and where a notebook can start.

The address of the repository is written once, in `pyproject.toml` under ``[tool.nrdob]``. As long
as it is empty nothing is shown that would need it.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import quote

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.util.docutils import SphinxDirective

from bundle import pack, to_run

PAGE = "get"
ARCHIVE = "_downloads/nrdob-notebooks.zip"
CHAPTERS = "chapters/"


def repository(project: Path) -> str:
    """Read the address of the repository; empty where there is none yet."""
    settings = tomllib.loads((project / "pyproject.toml").read_text("utf-8"))["tool"]["nrdob"]
    return str(settings["repository"]).rstrip("/").removesuffix(".git")


def starts(address: str, page: str) -> dict[str, str]:
    """Name the places where the notebook of a page can be started, with their addresses.

    Colab knows GitHub only.
    """
    if not (address and page.startswith(CHAPTERS)):
        return {}
    notebook = f"{page.removeprefix(CHAPTERS)}.ipynb"
    owner = address.partition("github.com/")[2]
    place = f"gh/{owner}" if owner else f"git/{quote(address, safe='')}"
    binder = f"https://mybinder.org/v2/{place}/main?urlpath=lab/tree/notebooks/{notebook}"
    colab = f"https://colab.research.google.com/github/{owner}/blob/main/notebooks/{notebook}"
    return {"Binder": binder} | ({"Colab": colab} if owner else {})


def link(name: str, url: str, icon: str, says: str) -> dict[str, str]:
    """Describe a button as the theme wants it."""
    return {"type": "link", "text": name, "url": url, "icon": icon, "tooltip": says,
            "label": f"get-{name.lower()}"}  # fmt: skip


def add_buttons(
    app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: object
) -> None:
    """Put what runs the page beside what downloads it."""
    if "header_buttons" not in context:
        return
    buttons = [
        link("All of it", context["pathto"](PAGE), "fas fa-box-archive", "Get the book and run it"),
        *(
            link(name, url, "fas fa-rocket", f"Run this chapter on {name}")
            for name, url in starts(app.config.nrdob_repository, page).items()
        ),
    ]
    context["header_buttons"].append(
        {"type": "group", "tooltip": "Run it", "icon": "fas fa-rocket",
         "buttons": buttons, "label": "run-buttons"}
    )  # fmt: skip


class Repository(SphinxDirective):
    """Where the project lives, in a paragraph; nothing as long as no address is set."""

    def run(self) -> list[nodes.Node]:
        address = self.config.nrdob_repository
        if not address:
            return []
        shown = nodes.reference(address, address, refuri=address)
        pieces = nodes.Text("The project lives at "), shown, nodes.Text(".")
        return [nodes.paragraph("", "", *pieces)]


def project_of(app: Sphinx) -> Path:
    """Find the folder of the project."""
    return Path(app.srcdir, app.config.nrdob_project).resolve()


def set_repository(app: Sphinx, config: Config) -> None:
    """Take the address over into the settings, where a change of it is noticed."""
    config.nrdob_repository = repository(project_of(app))


def write_archive(app: Sphinx, failed: Exception | None) -> None:
    """Lay the notebooks, with all that runs them, beside the pages."""
    if failed is None and app.builder.format == "html":
        pack(to_run(project_of(app)), Path(app.outdir) / ARCHIVE)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("nrdob_project", "..", "env", str)
    app.add_config_value("nrdob_repository", "", "html", str)
    app.connect("config-inited", set_repository)
    app.add_directive("repository", Repository)
    app.connect("html-page-context", add_buttons, priority=600)
    app.connect("build-finished", write_archive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
