"""Promises of `rcopterx inject`."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import Result
from support.fleets import HARDWARE_PAIR
from support.scripted import fleet_file_text
from typer.testing import CliRunner

from rcopterx.bus.channels import SIMULATOR_UNIT
from rcopterx.bus.requests import Inject, Reply
from rcopterx.bus.session import BusAddress, Session
from rcopterx.command_line import app
from rcopterx.simulator.faults import (
    AddSubject,
    BreakRadio,
    Occlude,
    Silence,
    SwapSubjects,
    TimedFault,
    timed_faults,
)


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


class ScriptedSimulator:
    """Accepts faults, or refuses them all for a reason."""

    def __init__(self, session: Session) -> None:
        self.faults: list[TimedFault] = []
        self.refusal = ""
        self._session = session
        self._stopping = threading.Event()
        session.serve(SIMULATOR_UNIT, ["inject"])
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping.wait(0.01):
            for incoming in self._session.pending():
                assert isinstance(incoming.request, Inject)
                self.faults += timed_faults(incoming.request.faults)
                incoming.answer(Reply(accepted=not self.refusal, reason=self.refusal))

    def close(self) -> None:
        self._stopping.set()
        self._thread.join()


@pytest.fixture
def simulator(join: Callable[..., Session]) -> Iterator[ScriptedSimulator]:
    running = ScriptedSimulator(join())
    yield running
    running.close()


@pytest.fixture
def up(bus_address: BusAddress, tmp_path: Path) -> str:
    """Fleet file of a fleet in the simulator: subjects heli1 and heli2."""
    path = tmp_path / "up.toml"
    text = fleet_file_text(bus_address) + "[simulator]\n"
    path.write_text(text.replace('subject = "h', 'subject = "heli'))
    return str(path)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (("silence", "duration_s=0.5"), Silence(duration_s=0.5)),
        (("occlude", "subject=heli1"), Occlude("heli1")),
        (("occlude", "subject=h2", "duration_s=1"), Occlude("heli2", duration_s=1.0)),
        (("swap-subjects", "subject=h1", "other=heli2"), SwapSubjects("heli1", "heli2")),
        (("add_subject", "subject=ghost", "position_m=[0,1,2]"), AddSubject("ghost", (0.0, 1.0, 2.0))),
        (("break_radio", "vehicle=h2", "condition=off"), BreakRadio("h2", "off")),
    ],
)
def test_fault_of_the_command_line_reaches_the_simulator(
    words: tuple[str, ...], fault: object, up: str, simulator: ScriptedSimulator
) -> None:
    result = run("inject", *words, "-f", up)
    assert result.exit_code == 0, result.stderr
    assert simulator.faults == [TimedFault(0.0, fault)]
    assert words[0].replace("-", "_") in result.output


def test_scenario_file_reaches_the_simulator_as_a_whole(
    up: str, simulator: ScriptedSimulator, tmp_path: Path
) -> None:
    path = tmp_path / "faults.toml"
    path.write_text("[[fault]]\nat_s = 1\nkind = 'silence'\n[[fault]]\nat_s = 0\nkind = 'close'\n")
    result = run("inject", "--scenario", str(path), "-f", up)
    assert [line.split() for line in result.output.splitlines()] == [
        ["0.00", "s", "close"],
        ["1.00", "s", "silence"],
    ]
    assert [line.at_s for line in simulator.faults] == [0.0, 1.0]


def test_refusal_of_the_simulator_is_told(up: str, simulator: ScriptedSimulator) -> None:
    simulator.refusal = "no subject 'heli9'; tracked are 'heli1', 'heli2'"
    result = run("inject", "occlude", "subject=heli9", "-f", up)
    assert (result.exit_code, result.stderr) == (1, f"error: refused: {simulator.refusal}\n")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((), "a fault is missing, see --list"),
        (("explode",), "unknown fault 'explode', known are close, reset, wrong_magic"),
        (("occlude",), "occlude: object missing required field `subject`"),
        (("close", "duration_s=1"), "close: object contains unknown field `duration_s`, allowed are none"),
        (("burst", "frames"), "'frames': must be FIELD=VALUE"),
        (("set_quality", "subject=h1", "quality=2"), "set_quality.quality: expected `float` <= 1.0"),
        (("close", "--scenario", "x.toml"), "either a fault or --scenario"),
        (("--scenario", "nowhere.toml"), "nowhere.toml: cannot be read: No such file or directory"),
    ],
)
def test_wrong_fault_is_a_usage_error_that_says_what_is_allowed(
    words: tuple[str, ...], reason: str, up: str
) -> None:
    result = run("inject", *words, "-f", up)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {reason}")


def test_fleet_that_flies_hardware_has_no_faults_to_inject(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(HARDWARE_PAIR)
    result = run("inject", "close", "-f", str(path))
    assert (result.exit_code, "flies hardware" in result.stderr) == (2, True)


def test_all_faults_are_listed_without_a_fleet() -> None:
    result = run("inject", "--list")
    assert result.exit_code == 0
    assert "swap_subjects" in result.output
    assert "Take two subjects for one another." in result.output


def test_an_agent_that_does_not_run_here_cannot_be_killed(up: str) -> None:
    result = run("inject", "kill_agent", "h1", "-f", up)
    assert result.exit_code == 2
    assert "no agent of h1 runs on this computer" in result.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [(("kill_agent",), "a vehicle is missing"), (("kill_agent", "h9"), "unknown vehicle 'h9'")],
)
def test_only_agents_of_vehicles_of_the_fleet_can_be_killed(
    words: tuple[str, ...], reason: str, up: str
) -> None:
    result = run("inject", *words, "-f", up)
    assert result.exit_code == 2
    assert reason in result.stderr
