"""Promises of `fly`: reports and a page about what was flown, and an exit code that sums it up."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from support.scripted import ScriptedVehicle
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.ground_station.acceptance.checks import Check
from rcopterx.ground_station.acceptance.flight import Manoeuvre
from rcopterx.ground_station.acceptance.flight_page import write_page
from rcopterx.ground_station.acceptance.steps import Step, in_order, refused
from rcopterx.ground_station.scripting import observer
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import NotReachedError

Vehicles = dict[str, ScriptedVehicle]
NAMES = ("h1", "h2", "h3")


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def seen(fleet: Fleet, say: Callable[[str], None], wait: Callable[[float], None]) -> None:
    """Wait until something has been recorded."""
    say("<looking>")
    fleet.wait_for_phase("flying")
    fleet["h1"].go_to((0.0, 0.0, 1.0))
    fleet["h1"].wait_for_arrival()
    wait(0.05)


def lost(fleet: Fleet, say: object, wait: object) -> None:
    raise NotReachedError("lost & gone")


def row(name: str, fly: Step, *checks: Check, fleet: str = "trio") -> Manoeuvre:
    return Manoeuvre(name, f"Title of {name}", 1.0, fly, checks, fleet=fleet)


GOOD = Check("good", lambda *_: (True, 1))
BAD = Check("bad < worse", lambda *_: (False, {"h1": 2}))
TABLE = {
    "fine": row("fine", seen, GOOD),
    "poor": row("poor", seen, GOOD, BAD),
    "lost": row("lost", lost, GOOD),
    "larger": row("larger", seen, GOOD, fleet="quintet"),
}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.ground_station.acceptance.flight.SETTLE_S", 0.0)


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> dict[str, Manoeuvre]:
    rows = dict(TABLE)
    monkeypatch.setattr("rcopterx.ground_station.acceptance.manoeuvres.MANOEUVRES", rows)
    return rows


@pytest.fixture
def names() -> tuple[str, ...]:
    return NAMES


def test_a_manoeuvre_that_passes_ends_with_0_and_writes_report_and_page(
    up: str, vehicles: Vehicles, table: object, tmp_path: Path
) -> None:
    result = run("fly", "fine", "-f", up, "--report", str(tmp_path / "out"))
    assert result.exit_code == 0, result.stderr
    assert result.stdout.startswith("fine: passed")
    assert "take-off to 1 m" in result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["verdict"] == "passed"
    assert [line["text"] for line in report["journal"]] == ["<looking>"]
    text = (tmp_path / "out" / "index.html").read_text()
    assert "1 passed" in text
    assert "&lt;looking&gt;" in text
    assert {vehicle.phase for vehicle in vehicles.values()} == {"ground"}


def test_a_check_that_fails_ends_with_1(up: str, table: object) -> None:
    result = run("fly", "poor", "-f", up)
    assert result.exit_code == 1
    assert "ok     good: 1" in result.stdout
    assert "FAILED bad < worse: {'h1': 2}" in result.stdout


def test_the_report_is_printed_as_json(up: str, table: object) -> None:
    assert json.loads(run("fly", "fine", "-f", up, "--json").stdout)["verdict"] == "passed"


def test_all_manoeuvres_are_flown_whatever_fails_and_the_page_shows_all_by_itself(
    up: str, vehicles: Vehicles, table: object, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    result = run("fly", "--all", "-f", up, "--report", str(out))
    assert result.exit_code == 1
    assert [line.split()[:2] for line in result.stdout.splitlines()] == [
        ["passed", "fine"], ["failed", "poor"], ["failed", "lost"], ["not", "flown"],
    ]  # fmt: skip
    assert "lost & gone" in result.stdout
    assert "made for the fleet quintet" in result.stdout
    assert {path.parent.name for path in out.rglob("report.json")} == {"fine", "poor", "lost"}
    text = (out / "index.html").read_text()
    for words in ("1 passed, 2 failed, 1 not flown", "lost &amp; gone", "bad &lt; worse", "Title of larger"):
        assert words in text
    assert text.index("1 passed, 2 failed") < text.index("flight.html"), "the summary comes first"
    links = re.findall(r"""(?:src|href)=["'](?!#)([^"']*)["']""", text)
    assert links == ["fine/flight.html", "poor/flight.html"], "what was seen can be played"
    for link in links:
        assert 'id="films"' in (out / link).read_text()


def test_a_fleet_that_is_not_ready_is_a_failure_with_the_reason(
    up: str, vehicles: Vehicles, table: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicles["h2"].ready = False
    monkeypatch.setattr(observer, "STARTED_S", 2.0)
    result = run("fly", "fine", "-f", up)
    assert result.exit_code == 1
    assert "after 2 s: not ready: h2: transmitter not ready" in result.stdout


def test_nothing_flown_is_no_success(up: str, table: dict[str, Manoeuvre]) -> None:
    for name in ("fine", "poor", "lost"):
        del table[name]
    result = run("fly", "--all", "-f", up)
    assert (result.exit_code, result.stdout.split()[:2]) == (1, ["not", "flown"])


def test_a_report_that_cannot_be_written_is_refused_before_anything_is_flown(
    up: str, vehicles: Vehicles, table: object, tmp_path: Path
) -> None:
    (tmp_path / "taken").touch()
    result = run("fly", "fine", "-f", up, "--report", str(tmp_path / "taken"))
    assert result.exit_code == 2
    assert "File exists" in result.stderr
    assert vehicles["h1"].requests == []


def test_a_name_and_all_exclude_each_other() -> None:
    result = run("fly", "hover", "--all")
    assert result.exit_code == 2
    assert "either names of manoeuvres or --all" in result.stderr


def test_what_has_to_be_refused_and_is_not_ends_the_manoeuvre(
    up: str, vehicles: Vehicles, table: dict[str, Manoeuvre]
) -> None:
    table["fine"] = row("fine", in_order(refused("nonsense", "h1", "lead")), GOOD)
    result = run("fly", "fine", "-f", up)
    assert result.exit_code == 1
    assert "nonsense was not refused" in result.stdout
    vehicles["h1"].refusals["lead"] = "no"
    assert run("fly", "fine", "-f", up).exit_code == 0


def test_a_page_of_nothing_but_words_needs_no_figures(tmp_path: Path) -> None:
    report = {
        "manoeuvre": "a<b", "title": "T", "seconds": 1.0, "verdict": "failed", "problem": "x < y",
        "checks": [],
        "pose_to_command_ms": None, "frame_to_radio_ms": None, "remarks": [], "vehicles": {}, "journal": [],
    }  # fmt: skip
    text = write_page([report], {}, tmp_path).read_text(encoding="utf-8")
    assert "a&lt;b" in text
    assert "x &lt; y" in text
