"""The pages of the package: one for each subpackage, and on it what each module shows, once.

The pages are written from the contracts of imports in pyproject.toml, the highest layer first.
Python describes the fields of a named tuple as "Alias for field number 0", long data by all they
hold, a function that is a default by its address, and the name of a type by what it stands for.
Here they get words; and where a page is narrow, names break at dots and brackets only.
"""

import re
import tomllib
from collections import namedtuple
from importlib import import_module
from inspect import isclass, isfunction
from pathlib import Path
from typing import Any

from docutils import nodes
from jinja2 import FileSystemLoader
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.addnodes import desc, desc_annotation, desc_content, desc_signature
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.pycode import ModuleAnalyzer

from getting import project_of
from pages import store

FIELD = type(vars(namedtuple("Any", "field"))["field"])
MADE = re.compile(r"<function (?:[\w.]*\.)?(?:(\w+)|<lambda>)>|<factory>")
"""A default as Python tells it: a function, perhaps with a name, or what a function makes."""

TITLE = re.compile(r"<h2><code.*?</code>")
OPENS = '<span class="sig-paren">(</span>'
LONGEST = 40
"""Characters of a value that can be read beside its name."""


def pages_of(project: Path) -> dict[str, str]:
    """Give the pages by name; modules beside the subpackages share the one called `loop`."""
    settings = tomllib.loads((project / "pyproject.toml").read_text("utf-8"))
    layers = {
        contract["containers"][0]: " | ".join(contract["layers"]).split(" | ")
        for contract in settings["tool"]["importlinter"]["contracts"]
        if "containers" in contract
    }
    inside = {name for name in layers["nrdob"] if f"nrdob.{name}" in layers}
    beside = [name for name in layers["nrdob"] if name not in inside and name != "__main__"]
    pages = {"loop": "# The loop, examples and plants\n" + sections("nrdob", beside)}
    for name in sorted(inside):
        package = f"nrdob.{name}"
        opening = f"# `{package}`\n\n```{{eval-rst}}\n.. automodule:: {package}\n```\n"
        pages[name] = opening + sections(package, layers[package])
    return pages


def sections(package: str, modules: list[str]) -> str:
    """Write a section for each module; what it shows of another one is described there."""
    written = ""
    for name in (f"{package}.{module}" for module in modules):
        module = import_module(name)
        things = {each: getattr(module, each) for each in module.__all__}
        named = {k: v for k, v in things.items() if isclass(v) or isfunction(v)}
        others = ", ".join(k for k, v in named.items() if v.__module__ != name)
        options = "   :members:\n" + (f"   :exclude-members: {others}\n" if others else "")
        written += f"\n## `{name}`\n\n```{{eval-rst}}\n.. automodule:: {name}\n{options}```\n"
    return written


def write_pages(app: Sphinx, _config: Config) -> None:
    """Lay the pages beside the others before they are read."""
    for name, text in pages_of(project_of(app)).items():
        store(text, Path(app.srcdir, "api", f"{name}.md"))


def skip_fields(_app: Sphinx, _what: str, _name: str, member: object, *_: object) -> bool | None:
    """Leave out the fields of named tuples, which are told under Attributes."""
    return True if isinstance(member, FIELD) else None


def name_functions(*given: Any) -> tuple[str | None, str | None]:
    """Show the name of a function that is a default, three dots if there is none."""
    *_, arguments, returned = given
    return MADE.sub(lambda found: found[1] or "...", arguments or "") or None, returned


def shorten_data(_app: Sphinx, doctree: nodes.document) -> None:
    """Show short values only, and the names of types as they are written."""
    for entry in doctree.findall(desc):
        if entry["objtype"] == "data":
            signature, content = entry[0], entry[-1]
            assert isinstance(signature, desc_signature) and isinstance(content, desc_content)
            for value in list(signature.findall(desc_annotation)):
                if len(value.astext()) > LONGEST:
                    signature.remove(value)
            for said in content.children:
                if said.astext().startswith("alias of "):
                    content.remove(said)
                    signature += desc_annotation("", f" = {written(signature)}")


def written(signature: desc_signature) -> str:
    """Return what the source says that a name stands for."""
    source = ModuleAnalyzer.for_module(signature["module"]).code
    found = re.search(rf"^{signature['fullname']} = (.+)$", source, re.MULTILINE)
    assert found
    return found[1]


def let_names_break(_app: Sphinx, page: str, _: str, context: Any, _doctree: object) -> None:
    """Let a line end after a dot of a module's name, and after the bracket of a call."""
    if page.startswith("api/"):
        body = context["body"].replace(OPENS, f"{OPENS}<wbr>")
        context["body"] = TITLE.sub(lambda title: title[0].replace(".", ".<wbr>"), body)


def compile_once() -> None:
    """Let all docstrings share the template of numpydoc, which would compile it for each."""
    folder = Path(docscrape_sphinx.__file__).parent / "templates"
    shared = SandboxedEnvironment(loader=FileSystemLoader(folder))
    docscrape_sphinx.SandboxedEnvironment = lambda loader: shared


def setup(app: Sphinx) -> dict[str, Any]:
    compile_once()
    app.connect("config-inited", write_pages)
    app.connect("autodoc-skip-member", skip_fields)
    # Before numpydoc, which would read every docstring once more in search of a signature.
    app.connect("autodoc-process-signature", name_functions, priority=400)
    app.connect("doctree-read", shorten_data)
    app.connect("html-page-context", let_names_break)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
