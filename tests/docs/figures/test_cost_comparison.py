"""Promises of the comparison of two checkouts: medians, ratios, and a reason where there is none."""

from pathlib import Path

import pytest

from cost import (
    TRIALS,
    CostError,
    Trial,
    compared,
    fleet_figures,
    largest_figures,
    main,
    manoeuvre_figures,
    measured,
    run,
    step_figures,
    table,
)


def test_ratios_are_those_of_the_medians() -> None:
    here = [{"load": 1.0}, {"load": 9.0}, {"load": 2.0}]
    there = [{"load": 4.0}, {"load": 4.0}, {"load": 100.0}]
    assert compared(here, there) == {"load": {"here": 2.0, "there": 4.0, "ratio": 0.5}}


def test_there_is_no_ratio_to_zero_and_none_of_what_only_one_knows() -> None:
    found = compared([{"load": 1.0, "new": 2.0}], [{"load": 0.0}])
    assert found == {"load": {"here": 1.0, "there": 0.0, "ratio": None}}


def test_loads_are_per_vehicle() -> None:
    row = {
        "vehicles": 3,
        "missed_ticks": 2,
        "cpu_share": {"agent": 0.6, "router": 0.15},
        "pose_to_command_ms": {"p50": 2.0, "p99": 5.0, "max": 9.0},
    }
    found = fleet_figures({"runs": [row]})
    assert found["total_share"] == pytest.approx(0.25)
    assert found["agent_share"] == pytest.approx(0.2)
    assert (found["missed_periods"], found["pose_to_command_p99_ms"]) == (2, 5.0)


def test_fleet_that_did_not_fly_is_an_error_with_its_problem() -> None:
    row = {"vehicles": 2, "missed_ticks": None, "problem": "no pose of h2"}
    with pytest.raises(CostError, match="no pose of h2"):
        fleet_figures({"runs": [row]})
    report = {"manoeuvre": "hover", "frame_to_radio_ms": None, "problem": "no vehicle is ready"}
    with pytest.raises(CostError, match="no vehicle is ready"):
        manoeuvre_figures(report)


def test_documents_of_the_other_trials_are_read() -> None:
    assert manoeuvre_figures({"frame_to_radio_ms": {"p99": 9.0}}) == {"frame_to_radio_p99_ms": 9.0}
    assert largest_figures({"largest_fleet": 6}) == {"largest_fleet": 6}
    steps = {"horizons": {"110": {"cascade": {"mean_ms": 0.5, "p999_ms": 3.0}}}}
    assert step_figures(steps) == {"mean_ms": 0.5, "p999_ms": 3.0}


def test_every_figure_is_a_line() -> None:
    rows = compared([{"aside": 3.0, "load": 1.0}], [{"aside": 0.0, "load": 4.0}])
    head, aside, load = table({"trials": {"six": rows}})
    assert head.split() == ["here", "there", "ratio"]
    assert load.split() == ["six:", "load", "1.000", "4.000", "0.25"]
    assert aside.split() == ["six:", "aside", "3.000", "0.000", "-"]


def test_command_without_a_document_is_an_error_with_its_last_line(tmp_path: Path) -> None:
    (tmp_path / "rcopterx").mkdir()
    (tmp_path / "rcopterx" / "__main__.py").write_text("import sys; sys.exit('no router answers')")
    with pytest.raises(CostError, match="bench scale ended with 1: no router answers"):
        measured(Trial(("bench", "scale"), lambda document: document), tmp_path)


def test_a_directory_that_is_no_checkout_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CostError, match="no checkout"):
        run(tmp_path, ["six"], 1, lambda _: pytest.fail("nothing is flown"))
    monkeypatch.setattr("sys.argv", ["cost.py", str(tmp_path)])
    with pytest.raises(SystemExit, match="no checkout"):
        main()


def test_a_trial_that_does_not_exist_is_refused_with_those_that_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["cost.py", str(tmp_path), "--only", "seven"])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert "largest" in capsys.readouterr().err


def test_a_trial_that_fails_leaves_the_figures_of_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rcopterx").mkdir()
    (tmp_path / "rcopterx" / "__init__.py").touch()

    def flown(trial: Trial, checkout: Path) -> dict[str, float]:
        if trial is TRIALS["six"]:
            raise CostError("no vehicle is ready")
        return {"load": 1.0}

    monkeypatch.setattr("cost.measured", flown)
    document = run(tmp_path, ["six", "trio"], 2, lambda _: None)
    assert document["failed"] == {"six": "no vehicle is ready"}
    assert document["trials"]["trio"]["load"]["ratio"] == 1.0
    monkeypatch.setattr("sys.argv", ["cost.py", str(tmp_path), "--only", "six", "trio"])
    with pytest.raises(SystemExit, match="six: no vehicle is ready"):
        main()
    assert "trio: load" in capsys.readouterr().out
