"""What the pages of the package show of each thing: its name, and what is told of it, once.

Python describes the fields of a named tuple as "Alias for field number 0", long data by all they
hold, a function that is a default by its address, and the name of a type by what it stands for.
Here they get words; and where a page is narrow, names break at dots and brackets only.
"""

from __future__ import annotations

import re
from collections import namedtuple
from typing import Any

from docutils import nodes
from sphinx.addnodes import desc, desc_annotation, desc_content, desc_signature
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

FIELD = type(namedtuple("Any", "field").field)
MADE = re.compile(r"<function (?:[\w.]*\.)?(?:(\w+)|<lambda>)>|<factory>")
"""A default as Python tells it: a function, perhaps with a name, or what a function makes."""

TITLE = re.compile(r"<h2><code.*?</code>")
OPENS = '<span class="sig-paren">(</span>'
LONGEST = 40
"""Characters of a value that can be read beside its name."""


def skip_fields(
    _app: Sphinx, _what: str, _name: str, member: object, _skip: bool, _options: object
) -> bool | None:
    """Leave out the fields of named tuples, which are told under Attributes."""
    return True if isinstance(member, FIELD) else None


def name_functions(
    _app: Sphinx,
    _what: str,
    _name: str,
    _thing: object,
    _options: object,
    arguments: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Show the name of a function that is a default, three dots if there is none."""
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


def let_names_break(
    _app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: object
) -> None:
    """Let a line end after a dot of a module's name, and after the bracket of a call."""
    if page.startswith("api/"):
        body = context["body"].replace(OPENS, f"{OPENS}<wbr>")
        context["body"] = TITLE.sub(lambda title: title[0].replace(".", ".<wbr>"), body)


def setup(app: Sphinx) -> dict[str, Any]:
    """Listen to autodoc, and look at each page that it has made."""
    app.connect("autodoc-skip-member", skip_fields)
    app.connect("autodoc-process-signature", name_functions)
    app.connect("doctree-read", shorten_data)
    app.connect("html-page-context", let_names_break)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
