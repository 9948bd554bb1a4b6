"""The icons of the pages, in place of the theme's script with two thousand of them.

Those that the pages show are cut out of it and become a style. The theme names its script in every
page; what is left of it is empty.
"""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import quote

from sphinx.application import Sphinx

from pages import installed

SHOWN = re.compile(r'class="[^"]*\bfas?(?:-solid)? fa-([a-z-]+)')
SCRIPT = "scripts/fontawesome.js"
RULES = """:is(.fas, .fa-solid) {
  background: currentcolor;
  display: inline-block;
  height: 1em;
  mask: var(--icon) center / contain no-repeat;
  vertical-align: -0.125em;
  width: 1.25em;
}

.btn .fa-lg {
  font-size: 1em;
}

@media (forced-colors: active) {
  :is(.fas, .fa-solid) {
    background: buttontext;
  }
}
"""


def icon(name: str, script: str) -> str:
    """Give the rule for an icon; of several drawings the last is the solid one."""
    drawn = re.findall(rf'\b"?{name}"?:\[(\d+),(\d+),\[[^\]]*\],"[0-9a-f]+","(M[^"]+)"', script)
    width, height, path = drawn[-1]
    box = f'xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
    picture = f'<svg {box}><path d="{path}"/></svg>'
    return f'.fa-{name} {{ --icon: url("data:image/svg+xml,{quote(picture)}"); }}\n'


def write(app: Sphinx, error: Exception | None) -> None:
    """Write the style, and empty the script."""
    if error or app.builder.format != "html":
        return
    static = Path(app.outdir, "_static")
    pages = (page.read_text("utf-8") for page in Path(app.outdir).rglob("*.html"))
    shown = sorted({name for page in pages for name in SHOWN.findall(page)})
    drawn = installed("pydata-sphinx-theme", f"static/{SCRIPT}").read_text("utf-8")
    rules = "".join(icon(name, drawn) for name in shown)
    (static / "icons.css").write_text(RULES + rules, encoding="utf-8")
    (static / SCRIPT).write_text("", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_css_file("icons.css")
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
