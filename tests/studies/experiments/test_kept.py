"""Flights that are kept in a file."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rcopterx.fleet.schema import FleetError
from rcopterx.vehicles.state import Array
from rcopterx_studies.experiments import kept
from rcopterx_studies.experiments.kept import KeptFlights

CONTEXT = {"experiment": "tea", "conditions": "ideal"}


@dataclass(frozen=True)
class Flown:
    """A result with everything that results are made of."""

    errors_m: Array
    counts: dict[str, int]
    lost: bool
    record: Array | None


def fly() -> Flown:
    return Flown(np.array([[1.0, np.nan], [0.1, -np.inf]]), {"late": 2}, lost=True, record=None)


def test_kept_flight_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    KeptFlights(path, CONTEXT).add("seed 1", fly())
    again = KeptFlights(path, CONTEXT)
    assert "seed 1" in again
    assert "seed 2" not in again
    result = again.result("seed 1", partial(fly))
    np.testing.assert_array_equal(result.errors_m, fly().errors_m)
    assert (result.counts, result.lost, result.record) == ({"late": 2}, True, None)


def test_flights_of_other_code_or_conditions_are_flown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flights.jsonl"
    KeptFlights(path, CONTEXT).add("seed 1", fly())
    assert "seed 1" not in KeptFlights(path, {**CONTEXT, "conditions": "laboratory"})
    monkeypatch.setattr(kept, "code_digest", lambda: "other")
    assert "seed 1" not in KeptFlights(path, CONTEXT)


def test_line_that_was_cut_off_is_dropped(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    KeptFlights(path, CONTEXT).add("seed 1", fly())
    with path.open("a", encoding="utf-8") as file:
        file.write('{"experiment": "te')
    KeptFlights(path, CONTEXT).add("seed 2", fly())
    again = KeptFlights(path, CONTEXT)
    assert "seed 1" in again
    assert "seed 2" in again


@pytest.mark.parametrize("line", ["tea", "[]", '{"flight": "seed 1"}', "3"])
def test_file_of_something_else_is_refused_and_left_as_it_is(tmp_path: Path, line: str) -> None:
    path = tmp_path / "notes.txt"
    path.write_text(f"{line}\n", encoding="utf-8")
    with pytest.raises(FleetError, match=r"notes\.txt, line 1: not a kept flight"):
        KeptFlights(path, CONTEXT)
    assert path.read_text(encoding="utf-8") == f"{line}\n"


def test_result_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    flights = KeptFlights(path, CONTEXT)
    flights.add("seed 1", {"errors": 1})
    work: partial[Any] = partial(fly)
    with pytest.raises(FleetError, match="seed 1: Object missing required field"):
        flights.result("seed 1", work)
