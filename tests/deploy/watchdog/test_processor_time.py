"""Promises of what excuses a process: only what the kernel says of its threads."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.deploy.watchdog.processor_time import ThreadTime, excuse_of, pressure_s, threads_of
from rcopterx.deploy.watchdog.watchdog import Excuse

MAIN, HELPER = 70, 71
states = st.sampled_from("RSDTt")
times = st.builds(ThreadTime, states, st.floats(0, 1e3), st.floats(0, 1e3))


def test_this_process_has_a_main_thread_that_runs() -> None:
    main = threads_of(os.getpid())[os.getpid()]
    assert main.state == "R"
    assert main.ran_s > 0


def test_nothing_is_known_of_a_process_that_has_ended(tmp_path: Path) -> None:
    assert threads_of(1, str(tmp_path)) == {}
    (tmp_path / "1" / "task" / "1").mkdir(parents=True)
    assert threads_of(1, str(tmp_path)) == {}


def test_the_name_of_a_program_may_contain_anything(tmp_path: Path) -> None:
    task = tmp_path / "7" / "task" / "7"
    task.mkdir(parents=True)
    (task / "stat").write_text("7 (a) R (b) T 1 7 7 0 -1\n")
    (task / "schedstat").write_text("1500000000 250000000 12\n")
    assert threads_of(7, str(tmp_path)) == {7: ThreadTime("T", 1.5, 0.25)}


@pytest.mark.parametrize(
    ("state", "excuse"),
    [
        ("T", Excuse(stopped=True)),
        ("t", Excuse(traced=True)),
        ("S", Excuse()),
        ("D", Excuse(waited_s=0.02)),
    ],
)
def test_the_main_thread_shows_whether_a_process_is_stopped_in_a_debugger_or_in_a_driver(
    state: str, excuse: Excuse
) -> None:
    now = {MAIN: ThreadTime(state, 1.0, 2.0), HELPER: ThreadTime("S", 0.0, 0.0)}
    assert excuse_of(MAIN, now, now, 0.02) == excuse


def test_a_thread_that_spins_has_not_waited() -> None:
    before, now = {MAIN: ThreadTime("R", 1.0, 2.0)}, {MAIN: ThreadTime("R", 1.02, 2.0)}
    assert excuse_of(MAIN, before, now, 0.02).waited_s == pytest.approx(0.0, abs=1e-12)


def test_a_thread_that_could_run_and_did_not_has_waited_though_its_wait_is_not_over() -> None:
    before, now = {MAIN: ThreadTime("S", 1.0, 2.0)}, {MAIN: ThreadTime("R", 1.005, 2.0)}
    assert excuse_of(MAIN, before, now, 0.02).waited_s == pytest.approx(0.015)


def test_a_loop_may_depend_on_any_thread_that_has_waited() -> None:
    before = {MAIN: ThreadTime("S", 1.0, 2.0), HELPER: ThreadTime("S", 1.0, 2.0)}
    now = {MAIN: ThreadTime("S", 1.0, 2.0), HELPER: ThreadTime("S", 1.001, 2.012)}
    assert excuse_of(MAIN, before, now, 0.02).waited_s == pytest.approx(0.012)


def test_a_thread_that_was_not_there_before_excuses_nothing() -> None:
    assert excuse_of(MAIN, {}, {MAIN: ThreadTime("R", 1.0, 2.0)}, 0.02) == Excuse()
    assert excuse_of(MAIN, {MAIN: ThreadTime("R", 1.0, 2.0)}, {}, 0.02) == Excuse()


@given(st.dictionaries(st.integers(1, 4), times), st.dictionaries(st.integers(1, 4), times), st.floats(0, 1))
def test_no_wait_is_negative_or_longer_than_the_time_that_passed(
    before: dict[int, ThreadTime], now: dict[int, ThreadTime], elapsed_s: float
) -> None:
    assert 0 <= excuse_of(1, before, now, elapsed_s).waited_s <= elapsed_s


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("some avg10=0.10 avg60=0.00 avg300=0.00 total=2500000\nfull avg10=0.00 total=7\n", 2.5),
        ("", 0.0),
        (None, 0.0),
    ],
    ids=["known", "empty", "unknown to the kernel"],
)
def test_the_pressure_is_the_time_for_which_any_process_has_waited(
    tmp_path: Path, text: str | None, seconds: float
) -> None:
    (tmp_path / "pressure").mkdir()
    if text is not None:
        (tmp_path / "pressure" / "cpu").write_text(text)
    assert pressure_s(str(tmp_path)) == seconds
