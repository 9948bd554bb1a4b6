"""The exam's key computed anew; the bench lab done on a simulated motor, its program compiled."""

from __future__ import annotations

import re
import subprocess
from math import inf, pi
from pathlib import Path
from typing import Any

import control as ct
import numpy as np
import pytest

from firmware import COMPILERS, compiler
from nrdob import NRDOB, LowPassFilter, delay, stabilizing_time_constants
from nrdob.design import gain_bound, right_half_plane_parity
from nrdob.digital import SampledLoop
from nrdob.drives import Drive, Encoder, Friction, OneMass

pytestmark = pytest.mark.thorough

TEACHING = Path(__file__).resolve().parents[2] / "book" / "teaching"
s = ct.tf("s")


@pytest.fixture(scope="module")
def key() -> dict[str, str]:
    text = (TEACHING / "exam.md").read_text("utf-8").split("## Key")[1].split("## Marks")[0]
    parts = re.split(r"^\*\*(\d)\.\*\* ", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_points_of_the_exam_sum_to_forty(key: dict[str, str]) -> None:
    questions = (TEACHING / "exam.md").read_text("utf-8").split("## Key")[0]
    worth = [int(points) for points in re.findall(r"\((\d+) points", questions)]
    assert sum(worth) == 40
    given = [sum(map(int, re.findall(r"\((\d+)\)", part))) for part in key.values()]
    assert given[:4] + given[5:] == worth[:4] + worth[5:]
    assert given[4] == 12  # all three parts, where question 6 is left out


def test_answers_1_and_2(key: dict[str, str]) -> None:
    w = np.linspace(1e-3, 2, 400)
    G = 2 / (s + 1)
    loop = NRDOB(G, G, 1, LowPassFilter(0.025, 2))
    assert np.abs(loop.S_d(1j * w)).max() <= 0.1 and "0.025" in key["1"]
    assert gain_bound(3) == pytest.approx(9) and "0<k<9" in key["2"]
    model = 1 / (s + 1)
    assert stabilizing_time_constants(8.9 * model, model, 3) == [(0.0, inf)]
    assert stabilizing_time_constants(9.1 * model, model, 3) == []
    assert stabilizing_time_constants(-0.1 * model, model, 3) == []


def test_answers_3_and_4(key: dict[str, str]) -> None:
    model = 1 / (s + 1)
    ((edge, last),) = stabilizing_time_constants(delay(0.1) * model, model, 1)
    assert last == inf and edge == pytest.approx(0.2 / pi)
    assert f"{edge:.4f}" in key["3"]
    plant = 2 / (s - 1)
    assert stabilizing_time_constants(plant, model, 1) == [(0.0, pytest.approx(2))]
    assert not right_half_plane_parity(plant, -model).holds
    assert NRDOB(plant, plant, 1, LowPassFilter(0.1, 1)).stability().stable is False


def test_answers_5_and_6(key: dict[str, str]) -> None:
    model = 1 / (s + 1)
    loop = NRDOB(model, model, 1, LowPassFilter(0.1, 3))
    assert loop.margins().observer_loop.gm == inf
    assert loop.margins().plant_loop.gm == pytest.approx(9)
    motor = 1 / (0.01 * s)
    for h, root in ((0.001, 0.75), (0.01, -1.5)):
        sampled = NRDOB(motor, motor, 0.1, LowPassFilter(0.004, 1)).sampled(h)
        assert sampled.stability().observer_loop.rightmost == pytest.approx(root)
        assert f"{root:g}" in key["6"]
    ((edge, _),) = stabilizing_time_constants(motor, motor, 1, dt=0.001)
    assert edge == pytest.approx(0.0005)


BLOCKS = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Run the page's Python on a record of a simulated motor, in a folder of its own."""
    folder = tmp_path_factory.mktemp("lab")
    drive = Drive(OneMass(0.01), Friction(0.05, viscous=0.2), Encoder(4000))
    h, rng = 0.001, np.random.default_rng(7)
    volts = np.repeat(rng.choice([-1, 1], 100) * rng.uniform(3, 9, 100), 200)
    motion, angles = drive.motion(h, 2 * h), []
    read = drive.reader(motion)
    for each in volts:
        angles.append(read(motion.angle))
        motion.advance(0.2 * float(each), 0.0)
    angle = np.array(angles)
    speed = (angle - np.concatenate([np.zeros(10), angle[:-10]])) / (10 * h)
    time = h * np.arange(volts.size)
    np.savetxt(folder / "motor.csv", np.transpose([time, volts, speed]), delimiter=",",
               header="t,u,y", comments="")  # fmt: skip
    space: dict[str, Any] = {}
    text = (TEACHING / "bench_lab.md").read_text("utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for language, block in BLOCKS.findall(text):
            if language == "python":
                exec(block, space)
            elif language == "c":
                (folder / "main.c").write_text(block)
    return folder, space


def test_the_bench_lab_leads_to_a_loop_that_holds(lab: tuple[Path, dict[str, Any]]) -> None:
    _, space = lab
    found, loop = space["found"], space["loop"]
    assert isinstance(loop, SampledLoop)
    assert loop.stability().stable is True
    assert found.process.delay < 0.012  # two samples of the drive, half a window of the speed
    assert found.process.tf.dcgain() == pytest.approx(1.0, rel=0.15)  # 0.2/0.2, less dry friction


@pytest.mark.parametrize("name", COMPILERS)
def test_the_program_of_the_bench_lab_compiles(lab: tuple[Path, dict[str, Any]], name: str) -> None:
    folder, _ = lab
    for file in ("main.c", "speed.c"):
        subprocess.run(
            [compiler(name), "-std=c99", "-Wall", "-Wextra", "-Werror", "-c", file, "-o", "a.o"],
            cwd=folder, check=True, capture_output=True,
        )  # fmt: skip
