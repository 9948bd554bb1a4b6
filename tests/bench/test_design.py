"""All stabilising filters, against the honest alternative: scanning λ with python-control's poles.

The scan has 200 time constants over four decades; a dead time is replaced by Padé(5) there.
"""

import time

import control as ct
import numpy as np
import pytest
from loops import CASES

import nrdob
from nrdob import paper
from nrdob.diagram import DelayedTransferFunction
from nrdob.plotting import TALL, Explorer, Figure, Slider, axes_for

SIDES = ["nrdob", "control"]
SCANNED = np.geomspace(1e-3, 10, 200)

rational = [(case.name, *case.blocks[:2], case.blocks[3].order) for case in CASES]
delayed = [
    (f"Example 4{' modified' if modified else ''}", loop.process, loop.model, 3)
    for modified in (False, True)
    for loop in [paper.example(4, modified)]
]

sides = pytest.mark.parametrize("side", SIDES)
mismatches = pytest.mark.parametrize(
    ("name", "process", "model", "order"),
    rational + delayed,
    ids=[m[0] for m in rational + delayed],
)


def scan(process, model, order):
    """Time constants of the grid at which control finds all poles in the left half plane."""
    if isinstance(process, DelayedTransferFunction):
        process = process.tf * ct.tf(*ct.pade(process.delay, 5))
    H = process / model - 1

    def poles(value):
        return ct.feedback(nrdob.LowPassFilter(value, order).tf * H).poles()

    return [np.max(poles(value).real, initial=-np.inf) < 0 for value in SCANNED]


@mismatches
@sides
def test_stabilising_set(race, side, name, process, model, order):
    def ours():
        return nrdob.stabilizing_time_constants(process, model, order)

    def theirs():
        return scan(process, model, order)

    race(f"stabilising set, {name}", side, ours, theirs)


@pytest.mark.parametrize("kind", ["butterworth", "bessel", "ramp", "interpolating"])
@mismatches
def test_stabilising_set_of_a_family(benchmark, name, process, model, order, kind):
    options = {"model": model} if kind == "interpolating" else {"order": order + (kind == "ramp")}
    family = nrdob.filter_family(kind, **options)
    benchmark(nrdob.stabilizing_time_constants, process, model, family)


def quickest(task, rounds=7):
    """Least processor time of several calls, in seconds, after one to warm up."""
    times = []
    for _ in range(rounds + 1):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return min(times[1:])


@pytest.mark.parametrize("wait", [0.0, 0.0437])
@mismatches
def test_the_set_of_a_family_against_that_of_the_lags(note, name, process, model, order, wait):
    order = max(order, 2)
    families = [nrdob.filter_family(kind, order) for kind in ("butterworth", "bessel")]
    families.append(nrdob.filter_family("ramp", order + (order == 2)))
    families.append(nrdob.filter_family("interpolating", model=model))
    if wait:
        model, name = nrdob.delay(wait) * model, f"{name}, the model waits"

    def one(filters):
        return quickest(lambda: nrdob.stabilizing_time_constants(process, model, filters))

    lags = {n: one(n) for n in {order, families[2].order}}
    ratios = ", ".join(
        f"{family.kind} {one(family) / lags.get(family.order, lags[order]):.1f}"
        for family in families
    )
    note(f"sets, {name}, lags 1 (below 2): {ratios}")


def test_a_verdict_with_two_dead_times_against_one(note):
    loop = paper.example(4)

    def one(model):
        return quickest(lambda: nrdob.judge_observer(loop.process, model, loop.filter))

    ratio = one(nrdob.delay(0.0437) * loop.model) / one(loop.model)
    note(f"verdict with two dead times, with one 1: {ratio:.1f} (below 3)")


AXES = {
    "time_constant": (0.005, 0.5),
    "gain": (0.1, 10.0),
    "delay": (0.0, 0.2),
    "lag": (0.0, 0.3),
}


@pytest.mark.parametrize("pair", [("time_constant", "delay"), ("gain", "lag"), ("gain", "delay")])
def test_stability_chart(benchmark, note, pair):
    loop = paper.example(4)
    x, y = ((name, *AXES[name]) for name in pair)
    benchmark(nrdob.stability_chart, loop.process, loop.model, loop.filter, x=x, y=y)
    if benchmark.stats:
        note(f"chart in {' and '.join(pair)}: {benchmark.stats.stats.min:.2f} s (below 1 s)")


@mismatches
def test_error_of_the_ends(note, name, process, model, order):
    intervals = nrdob.stabilizing_time_constants(process, model, order)
    ends = [end for pair in intervals for end in pair if SCANNED[0] < end < SCANNED[-1]]
    stable = np.array(scan(process, model, order))
    changes = np.flatnonzero(stable[1:] != stable[:-1])
    found = np.sqrt(SCANNED[changes] * SCANNED[changes + 1])
    if len(found) != len(ends):
        note(f"ends of the set, {name}: {len(ends)}, the scan finds {len(found)}")
    elif ends:
        errors = np.abs(found / np.array(ends) - 1)
        note(f"ends of the set, {name}: the scan is off by up to {100 * errors.max():.1f} %")


SPECIFICATIONS = [
    ("Example 2, Ms ≤ 1.6", 2, False, {"max_ms": 1.6}),
    ("Example 2 modified, Ms ≤ 2", 2, True, {"max_ms": 2.0}),
    ("Example 4, Ms ≤ 1.6", 4, False, {"max_ms": 1.6}),
    ("Example 4 modified, Ms ≤ 2", 4, True, {"max_ms": 2.0}),
]


@pytest.mark.parametrize(("name", "number", "modified", "specification"), SPECIFICATIONS)
def test_design_filter(benchmark, note, name, number, modified, specification):
    loop = paper.example(number, modified)
    benchmark(nrdob.design_filter, loop.process, loop.model, **specification)
    if benchmark.stats:
        note(f"design_filter, {name}: {1e3 * benchmark.stats.stats.min:.0f} ms (below 200 ms)")


def test_a_move_of_a_slider(benchmark, note):
    loop = paper.example(4)
    omega = np.geomspace(0.1, 300, 2000)
    H = loop.H(1j * omega)
    axes = axes_for(None, 2, TALL)
    (nyquist,) = axes[0].plot(H.real, H.imag)
    (gain,) = axes[1].loglog(omega, np.abs(H))

    def update(lag):
        FH = H / (1 + 1j * lag * omega) ** 3
        nyquist.set_data(FH.real, FH.imag)
        gain.set_ydata(np.abs(FH))
        return ""

    figure = Figure([nyquist, gain], axes, alt="Nyquist and Bode plot of F·H")
    explorer = Explorer(figure, [nyquist, gain], update, lag=Slider("λ (s)", 0.01, 1.0, 0.1, True))
    values = iter(np.tile(np.linspace(0.01, 1, 50), 1000))

    def move():
        explorer.move(lag=float(next(values)))
        return explorer.frame()

    benchmark(move)
    if benchmark.stats:
        note(f"a move of a slider: {1e3 * benchmark.stats.stats.median:.0f} ms (below 100 ms)")
