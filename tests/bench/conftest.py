"""Each measurement is made for nrdob and for control; the summary shows the ratio."""

import pytest

_times = pytest.StashKey[dict[str, dict[str, float]]]()
_notes = pytest.StashKey[list[str]]()


def pytest_configure(config):
    config.stash[_times], config.stash[_notes] = {}, []


@pytest.fixture
def measured(request):
    """Record how many seconds one side took for one task."""

    def record(task, side, seconds):
        request.config.stash[_times].setdefault(task, {})[side] = seconds

    return record


@pytest.fixture
def note(request):
    """Add a line to the summary."""
    return request.config.stash[_notes].append


@pytest.fixture
def race(benchmark, measured):
    """Time one side of a comparison."""

    def run(task, side, ours, theirs):
        benchmark.group = task
        benchmark(ours if side == "nrdob" else theirs)
        if benchmark.stats:
            # The fastest round is the one that the rest of the machine disturbed least.
            measured(task, side, benchmark.stats.stats.min)

    return run


def pytest_terminal_summary(terminalreporter, config):
    times = {task: sides for task, sides in config.stash[_times].items() if len(sides) == 2}
    if times:
        terminalreporter.section("nrdob against python-control")
        width = max(map(len, times))
        terminalreporter.line(f"{'':{width}}  {'nrdob':>10}  {'control':>10}  ratio")
    for task, sides in times.items():
        ours, theirs = sides["nrdob"], sides["control"]
        terminalreporter.line(
            f"{task:{width}}  {1e3 * ours:7.2f} ms  {1e3 * theirs:7.2f} ms  {ours / theirs:5.2f}"
        )
    for line in config.stash[_notes]:
        terminalreporter.line(line)
