"""Settings that every test shares."""

import gc
import os

# Before numpy loads: on a busy machine the threads of BLAS wait for each other, and a small
# eigenvalue problem takes a hundred times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import warnings

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from hypothesis import HealthCheck, settings

mpl.use("Agg")

# Derandomised, so that a red test is red for everyone; the deadline would measure the machine.
# The same few come each time, so more of them would find something once; tests/campaigns draw
# thousands, others for each seed.
settings.register_profile(
    "book",
    deadline=None,
    derandomize=True,
    max_examples=60,
    suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow],
)
settings.register_profile("quick", settings.get_profile("book"), max_examples=15)
settings.load_profile("book")


@pytest.fixture(autouse=True)
def _figures_are_closed():
    """Leave no figure open: the twenty-first warns, in whichever test draws it."""
    yield
    plt.close("all")


@pytest.fixture
def no_warning_leaks():
    """Turn every warning into an error, but for matplotlib's quarrels with its own parser."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for module in ("matplotlib", "pyparsing"):
            warnings.filterwarnings("ignore", category=DeprecationWarning, module=module)
        yield


LONG = {"site", "ledger_run", "graded"}
"""Fixtures that take a minute: the built book, the settled ledger, a graded class."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """What waits for a long fixture is thorough, what is thorough slow; their files come first.

    Else one of the processes that share the tests would begin with one when the others are done.
    """
    waiting = [item for item in items if LONG & set(getattr(item, "fixturenames", ()))]
    for item in waiting:
        item.add_marker(pytest.mark.thorough)
    for item in items:
        if item.get_closest_marker("thorough"):
            item.add_marker(pytest.mark.slow)
    first = {item.path for item in waiting}
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (item.path not in first, item.path not in slow))


def pytest_collection_finish():
    """Leave modules and tests, a million objects by now, out of every later search for garbage.

    And search less often: what the tests leave behind is small.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
