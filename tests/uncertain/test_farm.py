"""Executors that lose, break and never answer: nothing is lost, and the numbers are the same."""

import errno
import os
import signal
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from functools import cache

import numpy as np
import pytest

import nrdob
from nrdob import paper
from nrdob.uncertain import SweepStopped, farm
from nrdob.uncertain.draws import BLOCK

MEMBERS = 3 * BLOCK + 17


@cache
def asked():
    loop = paper.example(3)
    family = nrdob.family(loop.process, gain=(0.5, 2), lag=(0, 0.2), samples=MEMBERS, seed=5)
    return loop, family, "stable"


@cache
def here():
    return nrdob.sweep(*asked())


def same(table):
    return all(np.array_equal(table[name], here()[name]) for name in here().names)


class Moody(Executor):
    """Does at once what it is asked, but for some numbers of the submission."""

    def __init__(self, mood):
        self.mood, self.asked = mood, 0

    def submit(self, fn, /, *args, **kwargs):
        self.asked += 1
        future = Future()
        answer = self.mood(self.asked, lambda: fn(*args, **kwargs))
        if isinstance(answer, BaseException):
            future.set_exception(answer)
        elif answer is not None:
            future.set_result(answer)
        return future


def test_blocks_that_fail_or_are_lost_are_sent_again():
    def fails(number, work):
        return OSError("the worker is gone") if number in (1, 3, 5) else work()

    def silent(number, work):
        return None if number in (2, 4) else CancelledError() if number == 6 else work()

    assert same(nrdob.sweep(*asked(), executor=Moody(fails)))
    assert same(nrdob.sweep(*asked(), executor=Moody(silent), timeout=0.05))


def test_an_executor_that_never_answers_is_given_up_with_what_was_finished():
    with pytest.raises(SweepStopped, match="has not answered") as stopped:
        nrdob.sweep(*asked(), executor=Moody(lambda number, work: None), timeout=0.01)
    assert len(stopped.value.table) == 0

    def first(number, work):
        return work() if number == 1 else ValueError("no")

    with pytest.raises(SweepStopped, match="failed 4 times, at last with ValueError") as stopped:
        nrdob.sweep(*asked(), executor=Moody(first))
    table = stopped.value.table
    assert len(table) == BLOCK and np.array_equal(table["gain"], here()["gain"][table.rows])


def test_a_broken_executor_is_named_and_a_second_one_goes_on_where_it_stopped(tmp_path):
    def breaks(number, work):
        return work() if number < 3 else BrokenExecutor("killed")

    with pytest.raises(SweepStopped, match="executor is dead") as stopped:
        nrdob.sweep(*asked(), executor=Moody(breaks), keep=tmp_path)
    assert len(stopped.value.table) == 2 * BLOCK
    told = []
    table = nrdob.sweep(*asked(), keep=tmp_path, progress=lambda *now: told.append(now))
    assert told == [(2, 4), (3, 4), (4, 4)] and same(table)
    # Another question has blocks of its own; a damaged one is done again.
    for path in tmp_path.iterdir():
        path.write_bytes(b"half")
    assert same(nrdob.sweep(*asked(), keep=tmp_path))
    loop, *_ = asked()
    other = nrdob.family(loop.process, gain=(0.5, 2), lag=(0, 0.2), samples=50, seed=6)
    assert len(nrdob.sweep(loop, other, "stable", keep=tmp_path)) == 50


def test_a_shut_pool_is_named():
    pool = ProcessPoolExecutor(1)
    pool.shutdown()
    with pytest.raises(SweepStopped, match="give another executor"):
        nrdob.sweep(*asked(), executor=pool)


def test_a_full_disk_stops_the_sweep_with_what_was_finished(tmp_path, monkeypatch):
    count = 0
    save = np.savez

    def full(file, **columns):
        nonlocal count
        count += 1
        if count > 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        save(file, **columns)

    monkeypatch.setattr(farm.np, "savez", full)
    with pytest.raises(SweepStopped, match=r"No space left on device.*make room") as stopped:
        nrdob.sweep(*asked(), keep=tmp_path)
    assert len(stopped.value.table) == 3 * BLOCK
    monkeypatch.undo()
    assert len(list(tmp_path.iterdir())) == 2 and same(nrdob.sweep(*asked(), keep=tmp_path))


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OSError, match="give a folder"):
        nrdob.sweep(*asked(), keep=tmp_path / "file")


def test_progress_is_shown_on_a_terminal_only(monkeypatch, capsys):
    loop, _, _ = asked()
    family = nrdob.family(loop.process, gain=(0.5, 2), samples=5)
    nrdob.sweep(loop, family, "stable")
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(farm.sys.stderr, "isatty", lambda: True)
    nrdob.sweep(loop, family, "stable")
    out, err = capsys.readouterr()
    assert out == "" and err.endswith("sweep: 1 of 1 blocks\n")
    nrdob.sweep(loop, family, "stable", progress=False)
    assert capsys.readouterr() == ("", "")


def test_numbers_are_the_same_bit_for_bit_in_other_processes():
    loop = paper.example(4)
    family = nrdob.family(loop.process, gain=(0.3, 2), delay=(0, 0.1), samples=600)
    alone = nrdob.sweep(loop, family, ("stable", "ms", "gm", "pm", "delay_margin"))
    with ProcessPoolExecutor(1) as pool:
        sent = nrdob.sweep(loop, family, alone.names[5:-1], executor=pool)
    for name in alone.names:
        assert np.array_equal(alone[name], sent[name], equal_nan=alone[name].dtype == float)


@pytest.mark.slow
def test_a_worker_of_a_cluster_killed_in_mid_sweep_costs_nothing():
    dask, distributed = map(pytest.importorskip, ("dask", "distributed"))
    loop = paper.example(4)
    family = nrdob.family(loop.process, gain=(0.3, 2), delay=(0, 0.1), samples=3 * BLOCK)
    killed = []
    # Workers that are forked have everything imported.
    start = {
        "distributed.worker.multiprocessing-method": "fork" if hasattr(os, "fork") else "spawn"
    }
    with (
        dask.config.set(start),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())

        def told(finished, _):
            if finished >= 1 and not killed:
                killed.append(pids[0])
                os.kill(pids[0], signal.SIGKILL)

        table = nrdob.sweep(
            loop, family, "stable", executor=client.get_executor(), progress=told, timeout=60
        )
    assert killed and len(table) == 3 * BLOCK and table["decided"].all()
    few = nrdob.family(loop.process, gain=(0.3, 2), delay=(0, 0.1), samples=500)
    alone = nrdob.sweep(loop, few, "stable")
    for name in ("gain", "delay"):
        assert np.array_equal(table[name], family[name])
        assert np.array_equal(table[name][:500], alone[name])
    assert np.array_equal(table["stable"][:500], alone["stable"])
