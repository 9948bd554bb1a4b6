"""Sweeps against a loop over python-control: the same plants, the same verdicts, in one run.

    pytest tests/bench/test_sweep.py -s

Times are those of the processor, for each plant. python-control judges the first `FEW` plants of
the same family. With a dead time it is given Padé's fifth approximation, and where its verdict is
another one, the one-by-one method of the package says who is right.
"""

import resource
import subprocess
import sys
import time

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import paper

FEW = 300


def seconds(task):
    """What a task gives, and the least processor time of three calls."""
    times = []
    for _ in range(3):
        start = time.process_time()
        found = task()
        times.append(time.process_time() - start)
    return found, min(times)


def plants(number, count):
    loop = paper.example(number)
    more = {"delay": (0.0, 0.1)} if loop.delay else {"lag": (0.01, 0.2)}
    return loop, nrdob.plant_family(loop.process, gain=(0.5, 2.0), **more, samples=count)


def closed(loop, family, k):
    """L of a member as a user of python-control builds it, and whether it is stable."""
    G = loop.process.tf if loop.delay else loop.process
    G = G * family_column(family, "gain")[k]
    if loop.delay:
        G = G * ct.tf(*ct.pade(loop.delay + family_column(family, "delay")[k], 5))
    else:
        G = G * ct.tf([1], [family_column(family, "lag")[k], 1])
    L = loop.K.to_tf() * G
    return L, bool((ct.feedback(L).poles().real < 0).all())


_columns = {}


def family_column(family, name):
    key = id(family), name
    if key not in _columns:
        _columns[key] = family[name][:FEW]
    return _columns[key]


@pytest.mark.parametrize(
    ("name", "number", "count", "asked"),
    [
        ("rational, stability", 3, 100_000, "stable"),
        ("rational, with Ms", 1, 20_000, ("stable", "ms")),
        ("dead time, stability, Padé(5)", 4, 20_000, "stable"),
    ],
)
def test_a_sweep_is_faster_than_a_loop(name, number, count, asked, measured, note):
    loop, family = plants(number, count)
    _ = loop.K.to_tf()
    table, ours = seconds(lambda: nrdob.sweep(loop, family, asked))
    family_column(family, family.names[0])

    def one_by_one():
        verdicts = []
        for k in range(FEW):
            L, stable = closed(loop, family, k)
            if asked != "stable":
                _gm, pm, sm, _wpc, wgc, _wms = ct.stability_margins(L)
                _ = 1 / sm, np.radians(pm) / wgc
            verdicts.append(stable)
        return np.array(verdicts)

    theirs, slow = seconds(one_by_one)
    other = np.flatnonzero(theirs != table["stable"][:FEW])
    for k in other:
        one = nrdob.NRDOB(family[int(k)], loop.model, loop.controller, loop.filter)
        assert one.stability().stable == table["stable"][k]
    assert loop.delay or not other.size
    measured(f"{name}, a plant", "nrdob", ours / count)
    measured(f"{name}, a plant", "control", slow / FEW)
    note(f"{name}: {1e6 * ours / count:.2f} µs a plant, {slow / FEW / (ours / count):.0f} times "
         f"faster; {other.size} of {FEW} verdicts of python-control are wrong")  # fmt: skip


def test_pade_is_wrong_where_a_sweep_is_right(note):
    # A mode that the model does not know, at 20 rad/s behind a dead time of 1 s.
    lag = ct.tf([1], [1, 1])
    process = nrdob.delay(1.0) * lag * nrdob.plants.resonance(20.0, 0.02)
    loop = nrdob.NRDOB(process, lag, ct.tf([0.2], [1, 0]), nrdob.LowPassFilter(1.0, 1))
    family = nrdob.plant_family(process, gain=(0.5, 1.5), delay=(-0.1, 0.1), samples=FEW)
    table = nrdob.sweep(loop, family, "stable")
    K, verdicts = loop.K.to_tf(), []
    for gain, delay in zip(family["gain"], family["delay"], strict=True):
        L = K * process.tf * gain * ct.tf(*ct.pade(1.0 + delay, 5))
        verdicts.append(bool((ct.feedback(L).poles().real < 0).all()))
    wrong = np.flatnonzero(np.array(verdicts) != table["stable"])
    for k in wrong:
        one = nrdob.NRDOB(family[int(k)], loop.model, loop.controller, loop.filter)
        assert one.stability().stable == table["stable"][k]
    note(f"a fast mode behind a dead time: Padé(5) is wrong for {wrong.size} of {FEW} plants")
    assert wrong.size


CHILD = """
import sys, time, resource
import nrdob
def run(count):
    loop = nrdob.paper.example(3)
    family = nrdob.plant_family(loop.process, gain=(0.5, 2.0), lag=(0.01, 0.2), samples=count)
    start = time.perf_counter()
    nrdob.sweep(loop, family, "stable")
    print(time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)
if __name__ == "__main__":
    run(int(sys.argv[1]))
"""


def test_cost_grows_with_the_number_of_plants(note, tmp_path):
    program = tmp_path / "child.py"
    program.write_text(CHILD, encoding="utf-8")
    for count in (10**3, 10**4, 10**5, 10**6):
        said = subprocess.run(
            [sys.executable, str(program), str(count)],
            check=True, capture_output=True, text=True,
        ).stdout.split()  # fmt: skip
        each, memory = 1e6 * float(said[0]) / count, float(said[1])
        note(
            f"{count:8} rational plants: {float(said[0]):.3f} s, {each:.2f} µs a plant, "
            f"{memory:.2f} GB at most"
        )
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 1e6
