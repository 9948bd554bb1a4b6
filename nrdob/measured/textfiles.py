"""Files as tables of cells: encoding, what separates the columns, where headings are.

Nothing in a file is ever run.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mode

from .columns import known
from .parsing import ABSENT, NUMBER, is_value, short

__all__ = ["SEEN", "Sheet", "read_sheet"]

MOST_BYTES, MOST_ROWS = 50_000_000, 200_000  # sizes beyond which a file is refused
SEEN = 200  # lines by which it is found how columns are separated
# What may separate columns; where two explain the cells alike, the first. A blank is any white
# space.
SEPARATORS = ("\t", ";", "|", " ", ",")
COMMENT = re.compile(r"\s*(#|%|//)\s*")
STAMP = re.compile(r"\s*(\d\d?:\d\d:\d\d(?:[.,]\d+)?)\s+->\s+")  # by the monitor of a serial port
BEHIND = re.compile(r"(\s*[-+.\d].*\S)\s+(#|//)\s.*")  # a comment behind numbers
# A number behind its name, as for a serial plotter.
LABELLED = re.compile(rf"([^\W\d]\w*)\s*[:=]\s*({NUMBER.pattern})")
PLOTTED = re.compile(rf"((?:{STAMP.pattern})?)((?:{LABELLED.pattern}[\s,;|]*){{2,}})")
MARKUP = re.compile(r"\s*(\{|\[\s*[\[{]|<)")
MOST_BREAKS = 3  # lines over which a cell in quotes may go on
# What tells of columns with a number for each.
DESCRIBING = (
    "min", "max", "minimum", "maximum", "mean", "average", "std", "range", "gain", "scale",
    "factor", "offset", "port", "channel", "ch", "id",
)  # fmt: skip
UPPERS = 3  # lines of text above the numbers among which the headings are


@dataclass(frozen=True)
class Sheet:
    """A table of cells, the line of each row, and what was left out.

    Heads and the row of units below may be empty; blank is the first empty line among the rows.
    """

    rows: Sequence[Sequence[str]]
    lines: Sequence[int]
    heads: Sequence[str]
    units: Sequence[str]
    head_line: int
    separator: str
    blank: int
    notes: tuple[str, ...]


def read_sheet(path: Path) -> Sheet:
    """Split a file into cells, and find its headings."""
    text, notes = _text(path)
    name = short(path.name)
    every = list(enumerate(re.split(r"\r\n|\r|\n", text), 1))
    kept = [(k, _bare(line)) for k, line in every if line.strip() and not COMMENT.match(line)]
    if MARKUP.match(text):
        raise ValueError(
            f"{name} is no table, but looks like JSON or XML: save it as CSV, a row for each sample"
        )
    if not kept:
        raise ValueError(f"{name} is empty; it needs columns t, u and y")
    if len(kept) > MOST_ROWS:
        raise ValueError(
            f"{name} has {len(kept)} lines; at most {MOST_ROWS} are read: cut out the stretch "
            "that matters, or keep every tenth line"
        )
    kept, cut = _unstamped(_unlabelled(kept))
    notes += cut
    if named := re.fullmatch(r'"?sep=(.)"?', kept[0][1].strip(), re.I):  # for spreadsheets
        kept, separator = _joined(kept[1:]), named[1]
    else:
        kept = _joined(kept)
        separator = _separator([line for _, line in kept[:SEEN]])
    rows, lines = _parted(kept, separator)
    first, head, below = _layout(rows)
    heads = [cell.strip() for cell in rows[head]] if head is not None else []
    head_line = lines[head] if head is not None else 0
    if head is None and (above := _commented(every[: lines[0] - 1], separator, len(rows[0]))):
        head_line, heads = above
    while heads and not heads[-1]:
        heads.pop()
    if head or (head is None and not heads and first):
        begins = lines[first] if head is None else head_line
        what = "headings" if head else "numbers"
        notes += (f"{_are(1, begins - 1)} above the {what}, and not read as part of the table",)
    if head is not None and (between := lines[(below or head) + 1 : first]):
        notes += (f"{_are(between[0], between[-1])} between headings and numbers, and not read",)
    empty = {k for k, line in every if not line.strip(f" \t{separator}")}
    inside = [k for k in range(lines[first] if first < len(lines) else 0, lines[-1]) if k in empty]
    # A file of which every second line is empty has lost nothing.
    spaced = len(inside) >= len(lines) - first - 1
    return Sheet(
        rows[first:], lines[first:], heads, rows[below] if below is not None else (), head_line,
        separator, inside[0] if inside and not spaced else 0, notes,
    )  # fmt: skip


def _are(first: int, last: int) -> str:
    return f"line {first} is" if first == last else f"lines {first} to {last} are"


def _bare(line: str) -> str:
    """Cut off a comment behind numbers."""
    commented = ("#" in line or "//" in line) and '"' not in line
    return BEHIND.sub(r"\1", line) if commented else line


def _text(path: Path) -> tuple[str, tuple[str, ...]]:
    """Decode a file, or say in which line it is no text."""
    with path.open("rb") as file:
        raw = file.read(MOST_BYTES + 1)
    name = short(path.name)
    if len(raw) > MOST_BYTES:
        raise ValueError(
            f"{name} is larger than {MOST_BYTES // 10**6} MB; cut out the stretch that matters, "
            "some thousand samples"
        )
    notes: tuple[str, ...] = ()
    try:
        text = raw.decode(_encoding(raw))
        wrong = re.search(r"[\0-\x08\x0e-\x1f\x7f]", text)
        before = text[: wrong.start()].encode() if wrong else b""
    except UnicodeDecodeError as error:
        text = raw.decode("cp1252", errors="replace")
        wrong = re.search(r"[\0-\x08\x0e-\x1f\x7f\ufffd]", text)
        before = raw[: error.start]
        notes = ("the file is not in UTF-8; it was read as Latin-1 (Windows-1252)",)
    if wrong:
        line = before.count(b"\n") + 1
        raise ValueError(
            f"{name} is no table of text, see line {line}: save it as CSV, not as a spreadsheet; "
            "or, if that line alone is damaged, take it out"
        )
    return text.replace("\u2212", "-"), notes  # a minus sign of print


def _encoding(raw: bytes) -> str:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    start = raw[:200]
    for name, zeros, others in (
        ("utf-16-le", start[1::2], start[::2]), ("utf-16-be", start[::2], start[1::2])
    ):  # fmt: skip
        if len(start) > 10 and not any(zeros) and all(others):
            return name
    return "utf-8-sig"


def _unlabelled(kept: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Make headings of the names before all numbers; a line that has others is left as it is."""
    if not PLOTTED.fullmatch(kept[len(kept) // 2][1]):
        return kept
    found: list[tuple[int, str]] = []
    heading = ""
    for number, line in kept:
        if plotted := PLOTTED.fullmatch(line):
            pairs = [each.group(1, 2) for each in LABELLED.finditer(line, len(plotted[1]))]
            names, numbers = map("\t".join, zip(*pairs, strict=True))
            if not heading:
                heading = names
                found.append((number, plotted[1] + heading))
            line = plotted[1] + numbers if names == heading else line
        found.append((number, line))
    return found


def _unstamped(kept: list[tuple[int, str]]) -> tuple[list[tuple[int, str]], tuple[str, ...]]:
    """Make a column of the times that a monitor of a serial port writes before each line."""
    first, *others = kept
    if not others or not all(STAMP.match(line) for _, line in others):
        return kept, ()
    cut: tuple[str, ...] = ()
    if not STAMP.match(first[1]):
        kept = others
        cut = (f"line {first[0]}, which has no time, was taken for half a line and left out",)
    parts = [STAMP.split(line, maxsplit=1)[1:] for _, line in kept]
    separator = _separator([rest for _, rest in parts[:SEEN]])
    found = [
        (number, f"{'time' if rest[:1].isalpha() else stamp}{separator}{rest}")
        for (number, _), (stamp, rest) in zip(kept, parts, strict=True)
    ]
    return found, cut


def _joined(kept: Sequence[tuple[int, str]]) -> list[tuple[int, str]]:
    """Put lines together over which a cell in quotes goes on, as spreadsheets write them."""
    joined: list[tuple[int, str]] = []
    lines = iter(kept)
    for number, line in lines:
        more = [line]
        while len(more) < MOST_BREAKS and sum(part.count('"') for part in more) % 2:
            after = next(lines, None)
            if after is None:
                break
            more.append(after[1])
        joined.append((number, " ".join(more)))
    return joined


def _separator(sample: Sequence[str]) -> str:
    """Find what separates the columns: what makes the most cells numbers.

    Of such as make equally many, what makes the most lines alike, and then the fewest other cells
    beside numbers.
    """

    def found(separator: str) -> tuple[int, int, int, int]:
        rows = [row for line in sample if len(row := _cells(line, separator)) > 1]
        values = [[is_value(cell) for cell in row] for row in rows]
        numbers, place = sum(map(sum, values)), -SEPARATORS.index(separator)
        if not numbers:
            return 0, sum(map(len, rows)), 0, place
        widths = [len(row) for row in rows]
        beside = [row for row, each in zip(rows, values, strict=True) if any(each)]
        filled = sum(bool(cell.strip()) for row in beside for cell in row)
        return numbers, widths.count(mode(widths)), -filled, place

    return max(SEPARATORS, key=found)


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if '"' not in line:
        return line.split(separator)
    return next(csv.reader([line], delimiter=separator), [])


def _parted(kept: Sequence[tuple[int, str]], separator: str) -> tuple[list[list[str]], list[int]]:
    """Part all lines; rows without any cell that holds something are dropped."""
    rows, lines = [], []
    for number, line in kept:
        if line.count('"') % 2 and separator != " ":
            raise ValueError(
                f"line {number} opens a quotation mark that it does not close, nor do the "
                f"{MOST_BREAKS - 1} lines below: close it, or take it out"
            )
        try:
            cells = _cells(line, separator)
        except csv.Error as error:
            raise ValueError(f"line {number} cannot be read: {error}; look for quotes") from None
        if any(cell.strip() for cell in cells):
            rows.append(cells)
            lines.append(number)
    if not rows:
        raise ValueError("no line of the file holds anything but separators")
    while not any(row[-1].strip() for row in rows):  # what ends each line begins no column
        for row in rows:
            row.pop()
    return rows, lines


def _layout(rows: Sequence[Sequence[str]]) -> tuple[int, int | None, int | None]:
    """Find the first row of numbers, the headings and the row of units."""
    values = [sum(is_value(cell) for cell in row) for row in rows[:SEEN]]
    # Beside a name stand numbers that describe the table, where its rows begin with a number.
    numbered = is_value(rows[:SEEN][-1][0])
    enough = (k for k, count in enumerate(values) if count >= 2)
    first = next((k for k in enough if is_value(rows[k][0]) or not numbered), None)
    if first is None:  # no numbers at all, or one column of them: the headings are line 1
        return (1, 0, None) if values[0] == 0 else (0, None, None)
    width = max(len(row) for row in rows[first : first + 20])
    above: list[int] = []
    for k in reversed(range(first)):
        lone = sum(bool(cell.strip()) for cell in rows[k]) < 2
        name = rows[k][0].strip().lower()
        # Between headings and numbers an instrument may tell of the columns: "Port 851 851".
        # But a heading may be like a number, "24V" or "2024", beside others that are known.
        numbers = values[k] and known(set(rows[k])) < 2
        described = numbers and numbered and not is_value(name) and name not in ABSENT
        # One that has all its numbers is rather a sample, at "start" or "T-10", to be refused.
        full = len(rows[k]) == width > 2 and values[k] == width - 1
        if described and full and k == first - 1 and name not in DESCRIBING:
            first = k
            continue
        if not above and (lone or described):
            continue
        # The last one may have nothing below it: comments, where there are none.
        if numbers or lone or len(rows[k]) > width + 1 or len(above) == UPPERS:
            break
        above.append(k)
    if not above:
        # What stands there is no heading; it is a row like others, or nothing.
        if all(len(row) < 2 for row in rows[:first]):
            return first, None, None
        return (0, None, None) if values[0] else (1, 0, None)
    head = max(reversed(above), key=lambda k: known(rows[k]))
    return first, head, head + 1 if head + 1 in above else None


def _commented(
    above: Sequence[tuple[int, str]], separator: str, width: int
) -> tuple[int, list[str]] | None:
    """Find headings in the comment right above the numbers."""
    written = [(k, line) for k, line in above if line.strip()]
    if not written:
        return None
    number, line = written[-1]
    heads = [cell.strip() for cell in _cells(COMMENT.sub("", line, count=1), separator)]
    # A sentence may have as many words as there are columns.
    sure = known(heads) >= 2 or (separator != " " and width > 2)
    return (number, heads) if len(heads) == width and sure else None
