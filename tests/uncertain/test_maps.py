"""Maps: the exact borders of charts separate the colours that sweeps give."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import nrdob
from nrdob import paper


def crosses(curve, a, b):
    """Whether a polyline crosses the straight line from a to b."""
    x, y = curve
    p, q = np.array([x[:-1], y[:-1]]), np.array([x[1:], y[1:]])

    def turn(o, u, v):
        return (u[0] - o[0]) * (v[1] - o[1]) - (u[1] - o[1]) * (v[0] - o[0])

    sides = turn(a, b, p) * turn(a, b, q) <= 0
    return bool((sides & (turn(p, q, a[:, None]) * turn(p, q, b[:, None]) <= 0)).any())


@pytest.mark.parametrize(
    ("number", "x", "y"),
    [
        (3, ("gain", 0.3, 2.5), ("lag", 0.002, 0.2)),
        (2, ("gain", 0.3, 8.0), ("lag", 0.002, 0.3)),
        (4, ("delay", 0.0, 0.4), ("gain", 0.3, 6.0)),
    ],
)
def test_borders_separate_the_colours_of_a_map(number, x, y):
    loop = paper.example(number)
    start = loop.delay
    ranges = {name: (low, high) for name, low, high in (x, y)}
    family = nrdob.plant_family(loop.process, **ranges, grid=12)
    table = nrdob.sweep(loop, family, "stable")
    assert 0.1 < table["stable"].mean() < 0.95 and table["decided"].all()
    rows = {"x": table[x[0]] + start * (x[0] == "delay"), "y": table[y[0]]}
    moved = [
        (n, low + start * (n == "delay"), high + start * (n == "delay")) for n, low, high in (x, y)
    ]
    # A chart a little wider than the map, so that no border ends at its edge.
    wide = [(n, max(low - 1e-3, 0.0), high + 1e-3) for n, low, high in moved]
    chart = nrdob.stability_chart(loop.process, loop.model, loop.filter, x=wide[0], y=wide[1])
    names = sorted(ranges, key=["gain", "delay", "lag"].index)
    order = [names.index(n) for n in (x[0], y[0])]
    grid = [np.transpose(rows[k].reshape(12, 12), order) for k in ("x", "y")]
    stable = np.transpose(table["stable"].reshape(12, 12), order)
    parted = 0
    for i, j in np.ndindex(12, 12):
        for k, m in ((i + 1, j), (i, j + 1)):
            if max(k, m) < 12 and stable[i, j] != stable[k, m]:
                a, b = (np.array([g[p] for g in grid]) for p in ((i, j), (k, m)))
                parted += 1
                assert any(crosses((c.x, c.y), a, b) for c in chart.borders)
    assert parted > 5


def test_a_map_says_what_it_shows_and_wants_a_chart_of_the_same_two():
    loop = paper.example(4)
    family = nrdob.plant_family(loop.process, gain=(0.3, 6.0), delay=(-0.06, 0.3), grid=8)
    table = nrdob.sweep(loop, family, "stable")
    chart = nrdob.stability_chart(
        loop.process, loop.model, loop.filter, x=("delay", 0.01, 0.35), y=("gain", 0.3, 6.0)
    )
    drawn = table.plot_map("delay", "gain", chart=chart)
    for said in ("64 plants", "8 not decided", "exact borders", "dead time θ"):
        assert said in drawn.alt
    assert drawn.axes.flat[0].get_xlim()[1] == pytest.approx(0.35, abs=0.01)
    plt.close("all")
    with pytest.raises(ValueError, match="the chart is of delay and gain"):
        table.plot_map("gain", "delay", chart=chart)
    with pytest.raises(KeyError, match="no 'lag'"):
        table.plot_map("gain", "lag")


def test_a_map_draws_no_border_at_a_lag_below_zero():
    loop = paper.example(2)
    chart = nrdob.stability_chart(
        loop.process, loop.model, loop.filter, x=("gain", 0.3, 8.0), y=("lag", 0.0, 0.3)
    )
    assert min(border.y.min() for border in chart.borders) < 0
    family = nrdob.plant_family(loop.process, gain=(0.3, 8.0), lag=(0.0, 0.3), grid=4)
    drawn = nrdob.sweep(loop, family, "stable").plot_map("gain", "lag", chart=chart)
    lines = drawn.axes.flat[0].lines
    assert not any((np.asarray(line.get_ydata(), dtype=float) < 0).any() for line in lines)
    plt.close("all")
