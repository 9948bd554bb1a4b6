"""Letters and icons of the pages, shipped with the site.

One face for the text and one for formulas come out of installed packages, and are cut down to the
characters of the book: what a reader fetches is a tenth of them. The icons that the pages show are
cut out of the theme's script of two thousand and become a style; as the theme names its script in
every page, what is left of it is empty.
"""

import re
from pathlib import Path
from urllib.parse import quote

from fontTools import subset
from fontTools.ttLib import TTFont
from sphinx.application import Sphinx

from pages import installed, on_html

FACES = {
    "text": ("rendercv-fonts", "SourceSans3-Regular.ttf"),
    "text-italic": ("rendercv-fonts", "SourceSans3-Italic.ttf"),
    "text-bold": ("rendercv-fonts", "SourceSans3-Bold.ttf"),
    "math": ("ziamath", "STIXTwoMath-Regular.ttf"),
}
"""Each file of the site, and the package and the file that it is cut out of."""

TEXT = "20-7e a0-17f 2010-2027 2030-203a 20ac 2190-2193 2212 2248 2260 2264 2265 370-3ff"
FORMULAS = """
20-7e a0 a8 ac af b0 b1 b7 d7 2c6 2d9 2dc 303 391-3a9 3b1-3c9 3d1 3d5 3f1 3f5 2016 2026 2032-2034
2061 210b 210e 2110 2112 2113 211b 212c 2130 2131 2133 2190-2194 21d2 21d4 2200-2209 220f 2211-221e
2225 222b 223c 2248 2260-2265 226a 226b 22c5 22ef 2308-230b 239b-23b7 27e8 27e9 1d400-1d467
1d49c-1d4b5 1d5a0-1d5b9 1d6e4-1d71b
"""
"""Characters, as ranges of their numbers."""

SHOWN = re.compile(r'class="[^"]*\bfas?(?:-solid)? fa-([a-z-]+)')
SCRIPT = "scripts/fontawesome.js"


def cut(face: Path, ranges: str, output: Path) -> None:
    """Write the given characters of a face, and what formulas make of them, as WOFF2."""
    # Kerning and marks of a text; the smaller forms of a formula's indices.
    options = subset.Options(flavor="woff2", layout_features=["kern", "mark", "ssty"])
    font = subset.load_font(str(face), options)
    if "MATH" in font:
        narrow_roots(font)
    cutter = subset.Subsetter(options)
    cutter.populate(unicodes=subset.parse_unicodes(",".join(ranges.split())))
    cutter.subset(font)
    subset.save_font(font, str(output), options)


def narrow_roots(font: TTFont) -> None:
    """Give root signs of all heights one width: Chromium leaves room for the widest of them."""
    variants = font["MATH"].table.MathVariants
    sign = font.getBestCmap()[ord("√")]
    signs = variants.VertGlyphConstruction[variants.VertGlyphCoverage.glyphs.index(sign)]
    taller = [each.VariantGlyph for each in signs.MathGlyphVariantRecord]
    taller += [part.glyph for part in signs.GlyphAssembly.PartRecords]
    width, _ = font["hmtx"][sign]
    for name in taller:
        share = width / font["hmtx"][name][0]
        glyph = font["glyf"][name]
        glyph.coordinates.scale((share, 1))
        glyph.recalcBounds(font["glyf"])
        font["hmtx"][name] = (width, round(share * font["hmtx"][name][1]))


def icon(name: str, script: str) -> str:
    """Give the style of an icon; of several drawings the last is the solid one."""
    drawn = re.findall(rf'\b"?{name}"?:\[(\d+),(\d+),\[[^\]]*\],"[0-9a-f]+","(M[^"]+)"', script)
    width, height, path = drawn[-1]
    box = f'xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
    picture = f'<svg {box}><path d="{path}"/></svg>'
    return f'.fa-{name} {{ --icon: url("data:image/svg+xml,{quote(picture)}"); }}\n'


def write(_app: Sphinx, folder: Path) -> None:
    """Lay the faces beside the styles, once, write the style of the icons, and empty the script."""
    static = folder / "_static"
    (static / "fonts").mkdir(parents=True, exist_ok=True)
    for name, (package, file) in FACES.items():
        output = static / "fonts" / f"{name}.woff2"
        if not output.exists() or output.stat().st_mtime < Path(__file__).stat().st_mtime:
            cut(installed(package, file), FORMULAS if name == "math" else TEXT, output)
    pages = (page.read_text("utf-8") for page in folder.rglob("*.html"))
    shown = sorted({name for page in pages for name in SHOWN.findall(page)})
    drawn = installed("pydata-sphinx-theme", f"static/{SCRIPT}").read_text("utf-8")
    (static / "icons.css").write_text("".join(icon(name, drawn) for name in shown), "utf-8")
    (static / SCRIPT).write_text("", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_css_file("icons.css")
    app.connect("build-finished", on_html(write))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
