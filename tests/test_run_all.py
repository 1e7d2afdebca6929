"""Promises of what `make test` runs: all parts run, each line has its name, and either failure is one."""

import sys

import pytest
import run_all

PASSES = (sys.executable, "-c", "print('one'); print('two')")
HANGS = (sys.executable, "-X", "faulthandler", "-c", "import time; time.sleep(600)")
LEAVES = (sys.executable, "-c", "import subprocess; subprocess.Popen(('sleep', '30'))")
FAILS = (sys.executable, "-c", "import sys; print('three'); print('FAILED a'); sys.exit(3)")


@pytest.mark.parametrize(
    ("first", "second", "code"), [(PASSES, PASSES, 0), (FAILS, PASSES, 1), (PASSES, FAILS, 1)]
)
def test_either_failure_is_one(
    first: tuple[str, ...], second: tuple[str, ...], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_all, "RUNS", {"fleets": first, "units": second})
    assert run_all.main() == code


def test_every_line_has_its_name_and_failures_are_listed_at_the_end(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run_all, "RUNS", {"fleets": PASSES, "units": FAILS})
    run_all.main()
    lines = capsys.readouterr().out.splitlines()
    assert sorted(lines[:4]) == [
        "fleets | one",
        "fleets | two",
        "units  | FAILED a",
        "units  | three",
    ]
    assert lines[4:] == ["fleets: passed, 0.0 min", "FAILED a", "units: FAILED, 0.0 min"]


def test_run_that_hangs_shows_where_and_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run_all, "RUNS", {"units": HANGS})
    monkeypatch.setattr(run_all, "LIMIT_S", 5.0)
    assert run_all.main() == 1
    lines = capsys.readouterr().out
    assert 'File "<string>", line 1 in <module>' in lines
    assert "ERROR not ended after" in lines


def test_a_run_that_leaves_a_process_behind_names_it_and_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run_all, "RUNS", {"units": LEAVES})
    monkeypatch.setattr(run_all, "LAST_LINES_S", 0.2)
    assert run_all.main() == 1
    assert "(sleep 30 )" in capsys.readouterr().out


def test_every_test_but_campaigns_is_run_once() -> None:
    fleets, units = run_all.RUNS.values()
    assert "integration and not campaign" in fleets
    assert "not integration and not campaign" in units
    assert str(run_all.TESTS) in units
