"""What is folded on a page: a line to see, and the rest behind it, without a script.

::::{fold} claim reproduced
:name: claim-eq03
:lines: 2

What is always seen: the first block, or as many as `lines` says.

The rest.
::::

In a notebook the words of an answer are folded Markdown and its code is a folded cell. On a page
they would be two things to click, each called like all the others; here they become one card, the
"Solution of exercise 3". Any other folded cell says what is behind it.
"""

import re
from collections.abc import Callable
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from myst_nb.sphinx_ import HideCodeCellNode, visit_HideCellInput
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.docutils import SphinxDirective

OPENS = re.compile(r"<details><summary>(?:Solution|Hint)</summary>\s*")
CLOSES = re.compile(r"</details>\s*")
NUMBER = re.compile(r"(\d+)\.")
BRIEF = "Design brief"


class Card(nodes.General, nodes.Element):
    """What can be folded: its line, and the rest."""


class CardLine(nodes.General, nodes.Element):
    """What is seen of it when it is folded."""


class Fold(SphinxDirective):
    """A card: the classes as argument, the first blocks seen, the others folded."""

    optional_arguments = 1
    final_argument_whitespace = True
    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "name": directives.unchanged, "lines": directives.positive_int,
    }  # fmt: skip

    def run(self) -> list[nodes.Node]:
        blocks, seen = self.parse_content_to_nodes(), self.options.get("lines", 1)
        classes = " ".join(self.arguments).split()
        card = Card("", CardLine("", *blocks[:seen]), *blocks[seen:], classes=classes)
        self.add_name(card)
        return [card]


def element(name: str) -> tuple[Callable[[Any, Any], None], Callable[[Any, Any], None]]:
    """Give what begins an element of a page, and what ends it."""
    return (
        lambda translator, node: translator.body.append(translator.starttag(node, name)),
        lambda translator, _: translator.body.append(f"</{name}>\n"),
    )


class Folds(SphinxTransform):
    """Make a card of each answer in the exercises of a chapter, and name the other folded cells."""

    default_priority = 500

    def apply(self, **_: object) -> None:
        for exercises in self.document.findall(nodes.section):
            if "try-it" in exercises["ids"]:
                for part in list(exercises.findall(nodes.section)):
                    fold(part)
        for cell in self.document.findall(nodes.container):
            if cell.get("prompt_show") == self.config.nb_code_prompt_show:  # no name of its own
                draws = next(cell.findall(nodes.image), None) is not None
                held = "the check" if is_folded_cell(cell) else "how it is drawn" if draws else ""
                if held:
                    cell["prompt_show"], cell["prompt_hide"] = f"Show {held}", f"Hide {held}"


def fold(section: nodes.section) -> None:
    """Put the answers of a section into cards, one for each exercise."""
    of = "the design brief" if section[0].astext() == BRIEF else ""
    kept: list[nodes.Node] = []
    card: Card | None = None
    inside = False
    for node in section.children:
        opens, closes = is_html(node, OPENS), is_html(node, CLOSES)
        if opens or (card is None and is_folded_cell(node)):
            line = nodes.Text(f"Solution of {of}" if of else "Solution")
            card = Card("", CardLine("", line), classes=["solution"])
            kept.append(card)
        if opens or (inside and closes):
            inside = opens
        elif card is not None and (inside or is_folded_cell(node)):
            if is_folded_cell(node):
                node["hide_mode"] = None  # the card folds it
            card += node
        else:
            if not isinstance(node, nodes.raw):  # a remark that nobody sees parts nothing
                card = None
                of = exercise(node) or of
            kept.append(node)
    section.children = []
    section += kept


def is_html(node: nodes.Node, wanted: re.Pattern[str]) -> bool:
    """Tell whether a node is this piece of HTML and nothing else."""
    return isinstance(node, nodes.raw) and bool(wanted.fullmatch(node.astext()))


def is_folded_cell(node: nodes.Node) -> bool:
    """Tell whether a node is a cell of code that is shown on demand."""
    return isinstance(node, nodes.container) and node.get("hide_mode") == "all"


def exercise(node: nodes.Node) -> str:
    """Read which exercise begins here; empty if none does."""
    strong = next((each for each in node.children if each.astext()), None)
    if not isinstance(strong, nodes.strong):
        return ""
    if strong.astext().startswith(BRIEF):
        return "the design brief"
    return f"exercise {number[1]}" if (number := NUMBER.match(strong.astext())) else ""


def enter_folded_cell(translator: Any, node: HideCodeCellNode) -> None:
    """Begin any other folded cell; what is written on its toggle is what the toggle is called."""
    visit_HideCellInput(translator, node)
    label = translator.body.index('<summary aria-label="Toggle hidden content">\n', -5)
    translator.body[label] = "<summary>\n"


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_node(Card, html=element("details"))
    app.add_node(CardLine, html=element("summary"))
    app.add_node(HideCodeCellNode, override=True, html=(enter_folded_cell, element("details")[1]))
    app.add_directive("fold", Fold)
    app.add_transform(Folds)
    app.add_js_file("paper.js", loading_method="defer")
    return {"parallel_read_safe": True, "parallel_write_safe": True}
