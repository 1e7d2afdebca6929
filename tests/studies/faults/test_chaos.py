"""Chaos is the same for the same seed, and fails if a vehicle comes down."""

from collections import Counter
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import pytest

from rcopterx_studies.faults.chaos import PAUSE_S, SURVIVABLE, Chaos, chances, chaos_report
from rcopterx_studies.faults.promise import Promise, SeenFlight

FLEW = SeenFlight(30_000, 90.0, None, None, 300.0, ("armed", "hold", "armed"))
CHAOS = Chaos(SimpleNamespace(), 3, 600.0, 6, [(2.5, "router-killed")], Counter({"leader-spins": 1}))  # type: ignore[arg-type]  # flies nothing


def test_the_same_seed_gives_the_same_chaos_and_another_one_another() -> None:
    def first(seed: int) -> list[tuple[float, str]]:
        return [(pause_s, row.name) for pause_s, row in islice(chances(seed), 50)]

    assert first(1) == first(1)
    assert first(1) != first(2)


def test_what_happens_every_two_to_four_seconds_is_promised_to_be_survived() -> None:
    assert len(SURVIVABLE) >= 30
    assert all(row.promise is Promise.FLIES_ON for row in SURVIVABLE)
    pauses = [pause_s for pause_s, _ in islice(chances(0), 500)]
    assert PAUSE_S[0] <= min(pauses) < max(pauses) <= PAUSE_S[1]
    assert {row.name for _, row in islice(chances(0), 2000)} == {row.name for row in SURVIVABLE}


def test_chaos_in_which_no_vehicle_comes_down_has_passed() -> None:
    report = chaos_report(CHAOS, {"h1": FLEW}, None, 600.0)
    assert (report["verdict"], report["faults"], report["seed"], report["busy"]) == ("passed", 1, 3, 6)
    assert report["missed"] == {"leader-spins": 1}
    assert report["vehicles"]["h1"]["arbiter"] == {"armed": 2, "hold": 1}


@pytest.mark.parametrize(
    ("seen", "problem"), [(replace(FLEW, touchdown_m_s=0.3), None), (FLEW, "h1 on the floor"), (None, None)]
)
def test_chaos_has_failed_otherwise(seen: SeenFlight | None, problem: str | None) -> None:
    assert chaos_report(CHAOS, {"h1": seen} if seen else {}, problem, 10.0)["verdict"] == "failed"
