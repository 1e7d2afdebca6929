"""Pages are read from top to bottom, and typed: every command works with a simulated fleet."""

import re
import shutil
from pathlib import Path

import pytest
from reader_support import ROOT, lines_of, reader

RADIO = "tests/rcopterx/test_radio_commands.py"
NOT_TYPED = {
    r"^(\. \.venv|make |pip install (pre-commit|jupyterlab|pycdr2|\"rcopterx))": ".ci/run",
    r"^docker ": "tests/packaging/test_container_image.py",
    r"^jupyter ": "tests/examples/test_exercise_sheet.py",
    r"^pkill ": "tests/integration/shared_fleet/test_agent_deaths.py",
    r"^python examples/ros2_bridge/": "tests/examples/test_ros2_bridge.py",
    r"^python examples/light_show/": "tests/examples/test_flown_examples.py",
    r"^python -m tests.vicon_gateway.fuzz_datastream": "tests/vicon_gateway/test_fuzz_datastream.py",
    r"^rcopterx (bind|range-check) ": RADIO,
    r"^rcopterx bench solver ": "tests/benchmarks/test_solver_benchmark.py",
    r"^rcopterx calibrate (?!.*--step trim)": RADIO,
    r"^rcopterx deploy ": "tests/deploy/remote/test_deploy.py",
    r"^rcopterx experiment ": "tests/experiments/test_experiment_command.py",
    r"^rcopterx fly --all ": "tests/integration/test_flown_manoeuvres.py",
    r"^rcopterx fly --faults --up --report": "tests/integration/test_flown_faults.py",
    r"^rcopterx new-lab ": "tests/rcopterx/test_new_lab_command.py",
    r"^(sudo |echo |rcopterx udev-rules)": "docs/tested.md",
}
"""What is not typed here, and what shows it instead or says that nothing does: it needs radios or other
computers, takes hours, installs from an index of packages, changes this computer, or ends what others run."""

OWN_CONTROLLER = "pip install -e examples/own_controller"
INTO_THE_COPY = "pip install --quiet --no-deps --no-build-isolation --target plugins examples/own_controller"
UP, TAKE_OFF = "rcopterx up trio", "rcopterx takeoff"
LAB = "cp deploy/fleets/trio.toml lab.toml"
HOSTS = """cat >> lab.toml <<END
[hosts.main]
address = "127.0.0.1"
[hosts.control]
address = "127.0.0.2"
[security]
certificates = "$PWD/certificates"
END
sed -i 's/^.vehicles.h1.$/&\\nhost = "control"/' lab.toml"""
RECORDED = "rcopterx demo --no-browser --seconds 8"
BRIDGE = "cd examples/external_control && python http_bridge.py trio h1"
BRIDGE_LISTENS = "until (echo > /dev/tcp/127.0.0.1/8050) 2> /dev/null; do sleep 0.1; done"
DAEMONS_ANSWER = (
    "timeout 60 bash -c 'until (echo > /dev/tcp/127.0.0.2/7447) 2> /dev/null; do sleep 0.5; done'"
)
TOUR = "sed -n '/^t,x,y,z,yaw$/,/^```$/p' docs/trajectories.md | grep -v '```' > tour.csv"

BEFORE = {
    "control.md": {
        "rcopterx tune h2 horizon": [UP, TAKE_OFF],
        "rcopterx margins": [LAB],
        "cd examples/external_control && g++": [BRIDGE, BRIDGE_LISTENS],
    },
    "formation.md": {"rcopterx follow h3 h2 --offset 0,-1": [UP, TAKE_OFF]},
    "ground_station.md": {"rcopterx ground": [UP]},
    "hardware.md": {
        "rcopterx calibrate h2 --step trim": [LAB, "rcopterx up lab.toml", "rcopterx takeoff h2"]
    },
    "logs.md": {
        "rcopterx flights": [RECORDED, RECORDED],
        "rcopterx logs h2": [UP],
    },
    "motion_capture.md": {
        "rcopterx tracker": [LAB, "rcopterx up lab.toml"],
        "rcopterx replay-tracker": ["until [ -s session.raw ]; do sleep 0.1; done"],
    },
    "multi-host.md": {
        "rcopterx host lab.toml --host main": [LAB, HOSTS, "rcopterx certs lab.toml"],
        "rcopterx up lab.toml": [DAEMONS_ANSWER],
    },
    "operations.md": {"rcopterx check": [UP, TAKE_OFF]},
    "own_helicopter.md": {"rcopterx follow h2 h1": ["rcopterx up lab.toml", TAKE_OFF]},
    "real_time.md": {"rcopterx doctor": [LAB], "rcopterx status": [UP]},
    "security.md": {"rcopterx certs": [LAB, HOSTS]},
    "trajectories.md": {"rcopterx trajectory h1 waypoints": [TOUR]},
    "tutorial.md": {
        "rcopterx up lab.toml --without": [LAB],
        "rcopterx certs": [HOSTS],
    },
}
"""What a page says in a sentence that a reader has done before a line, by the line's beginning."""

AT_LAST = {
    "tutorial.md": "timeout 60 bash -c 'until rcopterx check -f lab.toml; do sleep 0.5; done'",
}
"""What must work when everything has been typed."""

PAGES = [
    page
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    if page.name != "decisions.md" and lines_of(page.read_text(encoding="utf-8"))
]


def instead(command: str) -> str | None:
    """Pattern of what is not typed, None for what is."""
    return next((pattern for pattern in NOT_TYPED if re.search(pattern, command)), None)


def test_whatever_is_not_typed_is_on_a_page_and_shown_elsewhere() -> None:
    lines = {line for page in PAGES for line in lines_of(page.read_text(encoding="utf-8"))}
    assert {pattern for line in lines if (pattern := instead(line))} == set(NOT_TYPED)
    for path in NOT_TYPED.values():
        assert (ROOT / path).exists(), path


def test_what_is_done_before_a_line_belongs_to_a_line() -> None:
    for name, done in BEFORE.items():
        lines = lines_of(next(page for page in PAGES if page.name == name).read_text(encoding="utf-8"))
        for beginning in done:
            assert any(line.startswith(beginning) for line in lines), (name, beginning)


def meant(command: str, flights: list[str]) -> str:
    """A command with the names that stand for something put in; flights are the newest first."""
    if command == OWN_CONTROLLER:
        return INTO_THE_COPY
    names = {"FILE": 0, "FLIGHT": 0, "OTHER": 1, "trio-20261122-141500": 0}
    for name, number in names.items():
        if re.search(rf"\b{name}\b", command):
            command = re.sub(rf"\b{name}\b", flights[number], command)
    return command


@pytest.mark.campaign
@pytest.mark.integration
@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_of_a_page_does_what_is_expected_of_it(page: Path, tmp_path: Path) -> None:
    before = dict(BEFORE.get(page.name, {}))
    with reader(tmp_path) as someone:
        for command in lines_of(page.read_text(encoding="utf-8")):
            for beginning in [beginning for beginning in before if command.startswith(beginning)]:
                for line in before.pop(beginning):
                    someone.type(line)
            if "octave-cli" in command and shutil.which("octave-cli") is None:
                continue
            if instead(command) is None:
                someone.type(meant(command, someone.flights()))
        if page.name in AT_LAST:
            someone.type(AT_LAST[page.name])
