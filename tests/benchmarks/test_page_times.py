"""Promises of measuring how soon the page can be used: from the start of the fleet, or of the page alone."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.fleets import PAIR

from rcopterx.benchmarks import page_times


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the benchmark does, with nothing behind it."""
    steps: list[str] = []

    def stands_for(name: str, yields: object = None) -> None:
        @contextmanager
        def stand_in(*_: object, **__: object) -> Iterator[object]:
            steps.append(name)
            yield yields
            steps.append(f"{name} ends")

        monkeypatch.setattr(page_times, name, stand_in)

    for name in ("launched", "browser", "started", "served"):
        stands_for(name)
    window = SimpleNamespace(close=lambda: None)
    monkeypatch.setattr(page_times, "opened", lambda *_: window)
    monkeypatch.setattr(page_times, "compile_all", lambda: None)
    return steps


def measured(path: Path, from_start: bool) -> dict[str, Any]:
    (path / "pair.toml").write_text(PAIR)
    return page_times.run(path / "pair.toml", 2, from_start, lambda _: None)


def test_from_the_start_fleet_and_page_are_started_for_each_run(done: list[str], tmp_path: Path) -> None:
    document = measured(tmp_path, from_start=True)
    one = ["started", "served", "served ends", "started ends"]
    assert done == ["browser", *one, *one, "browser ends"]
    assert (document["vehicles"], document["runs"], document["from_start"]) == (2, 2, True)
    assert document["usable_s"]["max"] >= document["served_s"]["max"] >= 0.0


def test_otherwise_the_fleet_is_up_before_the_first_run(done: list[str], tmp_path: Path) -> None:
    document = measured(tmp_path, from_start=False)
    one = ["served", "served ends"]
    assert done == ["launched", "browser", *one, *one, "browser ends", "launched ends"]
    assert document["from_start"] is False
