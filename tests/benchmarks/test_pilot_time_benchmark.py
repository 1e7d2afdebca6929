"""The comparison of two checkouts runs the code of either one."""

from pathlib import Path

from rcopterx.benchmarks.pilot_time import compared

ROOT = Path(__file__).parents[2]


def test_both_checkouts_are_flown_and_cost_something() -> None:
    here, there = compared(ROOT, ROOT, "laboratory", rounds=1, flight_s=0.2)
    assert here > 0.0
    assert there > 0.0
