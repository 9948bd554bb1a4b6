"""Draw the README's picture: the Nyquist plot of the unstable example."""

from pathlib import Path

from nrdob import paper

TARGET = Path(__file__).resolve().parents[2] / "book" / "_static" / "readme.png"

if __name__ == "__main__":
    TARGET.write_bytes(paper.example(3).plot_nyquist("FH", title="F·H, Example 3").png())
