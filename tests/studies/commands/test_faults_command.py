"""`faults` lists its table; `faults` and `fly` refuse what cannot be flown."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.fleet.reading import load_fleet
from rcopterx_studies.faults.bench import ENDURANCE_S, copied_fleet
from rcopterx_studies.faults.table import FAULT_FLIGHTS


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, " ".join(result.output.replace("│", " ").split())


def test_the_list_names_every_fault_with_its_promise() -> None:
    code, text = run("faults", "--list")
    assert code == 0
    assert all(name in text for name in FAULT_FLIGHTS)
    assert "lands open loop" in text


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("faults", "earthquake"), "unknown fault flight 'earthquake'"),
        (("faults", "--speed", "0.5"), "a running fleet keeps its speed; add --up"),
        (("fly",), "name a manoeuvre, or say --all"),
        (("fly", "--all", "hover"), "either names of manoeuvres or --all"),
        (("fly", "hover", "router-killed"), "unknown manoeuvre 'router-killed'"),
    ],
)
def test_what_cannot_be_flown_is_refused_with_the_reason(arguments: tuple[str, ...], reason: str) -> None:
    code, text = run(*arguments)
    assert code == 2
    assert reason in text


def test_faults_are_never_flown_with_real_helicopters(tmp_path: Path) -> None:
    from support.fleets import HARDWARE_PAIR

    path = tmp_path / "lab.toml"
    path.write_text(HARDWARE_PAIR)
    code, text = run("faults", "--up", "--fleet", str(path), "router-killed")
    assert code == 2
    assert "faults are flown in the simulator only" in text


def test_a_copy_of_the_fleet_with_lasting_batteries_is_flown_and_deleted() -> None:
    with copied_fleet("trio") as path:
        simulator = load_fleet(path).simulator
        assert simulator is not None
        assert simulator.condition_overrides == {"battery_endurance_s": ENDURANCE_S}
        assert simulator.conditions == "helicopter"
    assert not path.exists()
