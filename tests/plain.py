"""Everything of the package that a plain install promises, run with nothing else importable.

Run as `python -I plain.py FOLDER` with the package in FOLDER. Only what the package declares, with
what that declares in turn, can be imported; it prints what was run.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata as metadata
import pkgutil
import re
import sys
import tempfile
from pathlib import Path

EXTRAS = {"nrdob.plotting.diagrams": "notebooks"}
"""Modules that are for those who have an extra."""


def declared(name: str) -> set[str]:
    """Return the distributions that one brings, those of its extras left out."""
    found, todo = set[str](), [name]
    while todo:
        each = re.sub(r"[-_.]+", "-", todo.pop()).lower()
        if each in found:
            continue
        found.add(each)
        for line in metadata.requires(each) or []:
            if "extra ==" not in line:
                todo.append(re.match(r"[\w.-]+", line)[0])
    return found


class Nothing:
    """Finds no package that is not among those allowed."""

    def __init__(self, allowed: set[str]) -> None:
        self.shut = {
            top
            for top, names in metadata.packages_distributions().items()
            if not allowed & {re.sub(r"[-_.]+", "-", name).lower() for name in names}
        }

    def find_spec(self, name: str, *_: object) -> None:
        if name.partition(".")[0] in self.shut:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def asks_for(extra: str):
    """Check that what follows is refused, and names the command that brings what is missing."""
    refused = contextlib.ExitStack()

    def checked(kind, error, _):
        assert kind is not None and issubclass(kind, ImportError), f"no ImportError, but {error}"
        assert f'pip install "nrdob[{extra}]"' in str(error), error
        return True

    refused.push(checked)
    return refused


def main(folder: str) -> None:
    shut = Nothing(declared("nrdob"))
    for name in sys.modules.keys() & shut.shut:
        del sys.modules[name]
    sys.meta_path.insert(0, shut)
    sys.path.insert(0, folder)
    import nrdob

    assert Path(nrdob.__file__).is_relative_to(folder), nrdob.__file__
    assert not any(name.startswith("nrdob_course") for name in sys.modules)
    names = modules(nrdob)
    with tempfile.TemporaryDirectory() as place:
        pictures = everything(nrdob, Path(place))
    print(f"{names} names, {pictures} pictures, {len(shut.shut)} packages shut out")


def modules(nrdob) -> int:
    """Import every module but those of the course, and take every name that a front shows."""
    count = 0
    for found in pkgutil.walk_packages(nrdob.__path__, "nrdob."):
        if found.name.startswith("nrdob_course") or found.name == "nrdob.__main__":
            continue
        if found.name in EXTRAS:
            with asks_for(EXTRAS[found.name]):
                importlib.import_module(found.name)
            continue
        module = importlib.import_module(found.name)
        for name in getattr(module, "__all__", ()):
            if f"{found.name}.{name}" not in EXTRAS:
                getattr(module, name)
                count += 1
    for name in nrdob.__all__:
        getattr(nrdob, name)
        count += 1
    return count


def everything(nrdob, place: Path) -> int:
    """Draw every plot, write every report and all code; return the number of pictures."""
    import control as ct
    import matplotlib as mpl
    import numpy as np

    from nrdob import paper, plotting
    from nrdob.reporting import main as command

    mpl.use("agg")
    loop = paper.example(4)
    chart = nrdob.stability_chart(loop.process, loop.model, 3, x=("gain", 0.5, 2.0),
                                  y=("time_constant", 0.01, 0.3))  # fmt: skip
    table = nrdob.sweep(
        loop, nrdob.plant_family(loop.process, gain=(0.5, 2), delay=(0, 0.1), samples=9)
    )
    lines = plotting.axes_for(None, 1, plotting.SHORT)[0].plot([0, 1], [0, 1])
    line = plotting.Figure(lines, lines[0].axes, alt="A line")
    pictures = [
        loop.plot_nyquist(), loop.plot_bode(), loop.plot_step(), chart.plot(),
        table.plot_map("gain", "delay"), plotting.winding_plot([0.5], [0.2]),
        plotting.winding_animation([0.5], [0.2]), line,
    ]  # fmt: skip
    for picture in pictures:
        shown, _ = picture._repr_mimebundle_()
        assert shown["image/png"], picture
    slider = plotting.Slider("k", 0.0, 1.0, 0.5)
    explorer = plotting.Explorer(line, lines, lambda k: f"k {k}", k=slider)
    assert explorer.frame() and explorer._repr_mimebundle_()[0]["image/png"]
    with asks_for("notebooks"):
        explorer.widget()

    t = np.arange(200) * 0.1
    u = np.where(t < 1, 0.0, 1.0)
    y = ct.forced_response(ct.tf([2.0], [3.0, 1.0]), t, u).outputs
    y = y + 0.01 * np.sin(37 * np.arange(t.size) ** 2)
    csv = place / "data.csv"
    np.savetxt(csv, np.transpose([t, u, y]), delimiter=",", header="t,u,y", comments="")
    for subject in (loop, loop.process, nrdob.read_data(csv)):
        nrdob.report(subject, place / "report.html")
        assert "<svg" in (place / "report.html").read_text(encoding="utf-8")
    command(["report", "--process", "1/(s+1)", "--output", str(place / "again.html")])
    assert (place / "again.html").exists()

    sampled = loop.sampled(0.01)
    code = sampled.code()
    assert code.to_c() and code.to_header() and code.to_python()
    every = nrdob.alternatives.candidates(loop.process, loop.model, loop.controller, 3)
    compared = nrdob.compare(loop.process, every, max_ms=1.6)
    assert repr(compared) and compared._repr_html_()
    return len(pictures)


if __name__ == "__main__":
    main(sys.argv[1])
