"""Links between hosts that are cut and restored, with network namespaces as hosts."""

import time

import pytest
from support.bad_links import reset, slow
from support.cut_links import linked_hosts, measured_cut
from support.namespaces import network_or_skip
from support.waiting import wait_for

pytestmark = pytest.mark.integration


@pytest.fixture
def namespaces() -> None:
    """Network namespaces can be made here, or the test is skipped with the reason."""
    with network_or_skip(["probe"]):
        pass


@pytest.mark.usefixtures("namespaces")
def test_a_link_that_was_cut_for_a_second_carries_both_directions_again() -> None:
    with linked_hosts() as (net, streams):
        figures = measured_cut(net, streams, 1.0)
    for direction, row in figures.items():
        assert row["gap_ms"] > 900, f"{direction}: the link was not cut"
        assert row["heal_ms"] is not None, direction
        assert row["heal_ms"] < 5000, direction


@pytest.mark.campaign
@pytest.mark.usefixtures("namespaces")
@pytest.mark.parametrize("cut_s", [0.1, 0.3, 0.9, 1.0, 1.1, 3.0, 10.0])
def test_links_heal_in_half_a_second_whatever_the_length_of_the_cut(cut_s: float) -> None:
    with linked_hosts() as (net, streams):
        rounds = [measured_cut(net, streams, cut_s) for _ in range(5)]
    print(f"cut for {cut_s} s: {rounds}")
    for figures in rounds:
        for direction, row in figures.items():
            assert row["heal_ms"] is not None, direction
            assert row["heal_ms"] < 500, direction


@pytest.mark.campaign
@pytest.mark.usefixtures("namespaces")
def test_hosts_whose_round_trip_takes_long_are_linked_again() -> None:
    with linked_hosts() as (net, streams), slow(net, "b", delay_s=0.05, jitter_s=0.005):
        reset(net, "b")
        reset_s = time.monotonic()
        wait_for(
            lambda: all(stream.arrivals[-1][1] > reset_s for stream in streams.values()),
            "no samples that were sent since the reset",
            15.0,
        )
