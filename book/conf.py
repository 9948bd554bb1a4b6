"""Sphinx configuration of the book. Nothing here computes: chapters come executed."""

import gc
import shutil
import sys
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.errors import ConfigError

BOOK = Path(__file__).resolve().parent
sys.path[:0] = [str(BOOK / "ext"), str(BOOK / "make")]

# The pages are some millions of small objects, all needed to the end: searching them for garbage
# takes a sixth of the time.
gc.set_threshold(100_000, 50, 1000)

project = "The noise-reduction disturbance observer"
author = "the nrdob authors"
project_copyright = "2026, the nrdob authors"
release = version = distribution("nrdob").version
language = "en"

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinxcontrib.bibtex",
    "apipages",
    "chapters",
    "explorable",
    "findable",
    "folds",
    "fonts",
    "getting",
    "maps",
    "mentions",
    "published",
    "typeset",
]

# The problem sets lie there with their solutions.
exclude_patterns = ["nrdob_course/**"]

# --- Text -------------------------------------------------------------------------------------
myst_enable_extensions = [
    "amsmath", "attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath",
]  # fmt: skip
myst_heading_anchors = 3
numfig = False  # captions name the paper's own figure numbers
highlight_language = "none"  # text diagrams are no Python; doctests are seen as such anyway
nb_execution_mode = "off"
nb_code_prompt_show, nb_code_prompt_hide = "Show the code", "Hide the code"
nb_ipywidgets_js: dict[str, dict[str, str]] = {}  # the default asks other servers for scripts
bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

# --- API pages --------------------------------------------------------------------------------
add_module_names = False  # the heading above names the module
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True  # as they are written, such as structures=STRUCTURES
autodoc_typehints = "none"  # the docstrings tell type, shape and unit
numpydoc_show_class_members = False
# Types of the libraries below us; their documentation is not part of this book.
nitpick_ignore_regex = [
    ("py:.*", r"(collections\.abc|control|ct|matplotlib|np|numpy|scipy)\..*"),
]

# --- Look -------------------------------------------------------------------------------------
html_math_renderer = "formulas"
html_theme = "sphinx_book_theme"
html_title = project
html_static_path = ["_static"]
templates_path = ["templates/theme"]
html_css_files = ["book.css"]
html_context = {"default_mode": "auto"}
html_theme_options = {
    "navbar_persistent": [],  # else there are two search fields
    "use_download_button": True,
    "show_toc_level": 2,
}
html_copy_source = True
html_show_sphinx = False
html_domain_indices = False  # the list of modules is the page of the package


def copy_chapters(_app: Sphinx, config: Config) -> None:
    """Bring the notebooks under the source folder, above which Sphinx cannot see."""
    source = (BOOK / config.nrdob_notebooks).resolve()
    notebooks = sorted(source.glob("*.ipynb"))
    if not notebooks:
        raise ConfigError(f"no notebooks in {source}")
    chapters = BOOK / "chapters"
    chapters.mkdir(exist_ok=True)
    for old in chapters.glob("*.ipynb"):
        if not (source / old.name).exists():
            old.unlink()
    for notebook in notebooks:
        copy = chapters / notebook.name
        # Unchanged files keep their time, so that Sphinx reads again only what is new.
        if not copy.exists() or copy.read_bytes() != notebook.read_bytes():
            shutil.copyfile(notebook, copy)


GENERATED = {"book/make/ledger.py": ("ledger.md", "errata.md")}


def require_generated(_app: Sphinx, _config: Config) -> None:
    """Stop where generated pages are missing, and say what makes them."""
    for tool, pages in GENERATED.items():
        missing = [name for name in pages if not (BOOK / name).exists()]
        if missing:
            raise ConfigError(
                f"{' and '.join(missing)} not in {BOOK}. They are made by: python {tool} "
                "(make book does it by itself)"
            )


def lead_to_chapters(_app: Sphinx, page: str, source: list[str]) -> None:
    """Turn the links to notebooks, which lead somewhere without a build, into those of the book."""
    if page.startswith("teaching/"):
        source[0] = source[0].replace("(../../notebooks/", "(../chapters/")


def add_filter(
    app: Sphinx, page: str, _template: str, _context: dict[str, Any], _doctree: object
) -> None:
    """Let the ledger be filtered."""
    if page == "ledger":
        app.add_js_file("claims.js", loading_method="defer")


def setup(app: Sphinx) -> None:
    """Add the setting that names the folder of executed notebooks, seen from here."""
    app.add_config_value("nrdob_notebooks", "../notebooks", "env", str)
    app.connect("config-inited", copy_chapters)
    app.connect("config-inited", require_generated)
    app.connect("source-read", lead_to_chapters)
    app.connect("html-page-context", add_filter)
