"""From every page to a copy that runs: what can be downloaded, and where a notebook can start.

The address of the repository is written once, in `pyproject.toml` under ``[tool.nrdob]``. As long
as it is empty nothing is shown that would need it.
"""

import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import quote

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.util.docutils import SphinxDirective

from bundle import to_run
from nrdob_course.grading.platforms import pack
from pages import on_html

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


def add_buttons(app: Sphinx, page: str, _: str, context: Any, _doctree: object) -> None:
    """Put what runs the page beside what downloads it, as the theme wants it."""
    if "header_buttons" not in context:
        return
    rocket, here = "fas fa-rocket", context["pathto"](PAGE)
    places = [("All of it", here, "fas fa-box-archive", "Get the book and run it")]
    for name, url in starts(app.config.nrdob_repository, page).items():
        places.append((name, url, rocket, f"Run this chapter on {name}"))
    keys = ("text", "url", "icon", "tooltip")
    told = [dict(zip(keys, place, strict=True)) for place in places]
    buttons = [{"type": "link", "label": f"get-{each['text'].lower()}", **each} for each in told]
    group = {"type": "group", "label": "run-buttons", "icon": rocket, "tooltip": "Run it"}
    context["header_buttons"].append({**group, "buttons": buttons})


class Repository(SphinxDirective):
    """Where the project lives, in a paragraph; nothing as long as no address is set."""

    def run(self) -> list[nodes.Node]:
        address = self.config.nrdob_repository
        if not address:
            return []
        text, messages = self.parse_inline(f"The project lives at <{address}>.")
        return [nodes.paragraph("", "", *text), *messages]


def project_of(app: Sphinx) -> Path:
    """Find the folder of the project."""
    return Path(app.srcdir, app.config.nrdob_project).resolve()


def set_repository(app: Sphinx, config: Config) -> None:
    """Take the address over into the settings, where a change of it is noticed."""
    config.nrdob_repository = repository(project_of(app))


def write_archive(app: Sphinx, folder: Path) -> None:
    """Lay the notebooks, with all that runs them, beside the pages."""
    pack(folder / ARCHIVE, dict(to_run(project_of(app))))


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_config_value("nrdob_project", "..", "env", str)
    app.add_config_value("nrdob_repository", "", "html", str)
    app.connect("config-inited", set_repository)
    app.add_directive("repository", Repository)
    app.connect("html-page-context", add_buttons, priority=600)
    app.connect("build-finished", on_html(write_archive))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
