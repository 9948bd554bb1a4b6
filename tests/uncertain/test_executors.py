"""Sweeps by executors: the same numbers in other processes, and on a Dask cluster."""

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import nrdob
from nrdob import paper
from nrdob.uncertain.distributions import BLOCK

QUANTITIES = ("stable", "ms", "gm", "pm", "delay_margin")


def drawn(samples):
    loop = paper.example(4)
    return loop, nrdob.plant_family(loop.process, gain=(0.3, 2), delay=(0, 0.1), samples=samples)


def assert_same(one, other):
    assert one.names == other.names and len(one) == len(other)
    for name in one.names:
        assert np.array_equal(one[name], other[name], equal_nan=one[name].dtype == float)


def test_numbers_are_the_same_bit_for_bit_in_other_processes():
    loop, plants = drawn(600)
    with ProcessPoolExecutor(1) as pool:
        sent = nrdob.sweep(loop, plants, QUANTITIES, executor=pool)
    assert_same(sent, nrdob.sweep(loop, plants, QUANTITIES))


@pytest.mark.slow
def test_the_executor_of_a_dask_client_takes_whole_blocks():
    distributed = pytest.importorskip("distributed")
    loop, plants = drawn(BLOCK + 500)
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None, processes=False
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        table = nrdob.sweep(loop, plants, "stable", executor=client.get_executor())
    assert_same(table, nrdob.sweep(loop, plants, "stable"))
