"""The letters of the pages: one face for the text and one for formulas, shipped with the site.

Both come out of installed packages, and are cut down to the characters of the book: what a reader
fetches is a tenth of them.
"""

from __future__ import annotations

from pathlib import Path

from fontTools import subset
from fontTools.ttLib import TTFont
from sphinx.application import Sphinx

from pages import installed

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


def write(app: Sphinx, error: Exception | None) -> None:
    """Lay the faces beside the styles, once."""
    if error or app.builder.format != "html":
        return
    folder = Path(app.outdir, "_static", "fonts")
    folder.mkdir(parents=True, exist_ok=True)
    for name, (package, file) in FACES.items():
        output = folder / f"{name}.woff2"
        if not output.exists() or output.stat().st_mtime < Path(__file__).stat().st_mtime:
            cut(installed(package, file), FORMULAS if name == "math" else TEXT, output)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
