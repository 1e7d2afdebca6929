"""Pages are read from top to bottom, and typed: every command works with a simulated fleet."""

import re
import shutil
from pathlib import Path

import pytest
from reader_support import ROOT, Reader, cells_of, lines_of, reader

INSTALLS, RADIO = "installs what is in no copy of the repository", "wants a radio module and a hand on it"
HOURS, DAEMON = "takes half an hour and more", "wants a container daemon"
COMPUTER, OTHERS = "changes this computer, as root", "wants another computer"
DOCKER = "docker run --rm -it --network host --cap-add SYS_NICE --ulimit rtprio=40"
BRIDGE_TO_ROS = "python examples/ros2_bridge/ros2_bridge.py --fleet trio --ros tcp/192.168.1.20:7447"
EXPERIMENTS = "tests/studies/commands/test_experiment_command.py"
RADIOS = "tests/rcopterx/test_radio_commands.py"
WHEEL = "tests/packaging/test_installed_wheel.py"
IMAGE = "tests/packaging/test_container_image.py"

NOT_TYPED = {
    ". .venv/bin/activate": (INSTALLS, "tests/packaging/test_fresh_clone.py"),
    "make demo": (INSTALLS, "tests/packaging/test_fresh_clone.py"),
    "make test": (INSTALLS, ".ci/run"),
    'make measure ARGS="--tests"': (
        "needs the history and an idle computer",
        "docs/figures/measure_commit.py",
    ),
    "python3 -m venv lab": (INSTALLS, WHEEL),
    ". lab/bin/activate": (INSTALLS, WHEEL),
    "pip install rcopterx-*.whl": (INSTALLS, WHEEL),
    "rcopterx demo --no-browser": (INSTALLS, WHEEL),
    'pip install "rcopterx-studies[bench]"': (INSTALLS, "tests/packaging/test_extras.py"),
    "pip install jupyterlab": (INSTALLS, "tests/examples/test_exercise_sheet.py"),
    "pip install pycdr2": (INSTALLS, "tests/examples/test_ros2_bridge.py"),
    "docker build -t rcopterx -f packaging/Dockerfile .": (DAEMON, IMAGE),
    "docker run --rm -it --cap-add SYS_NICE --ulimit rtprio=40 rcopterx": (DAEMON, IMAGE),
    f"{DOCKER} rcopterx demo": (DAEMON, IMAGE),
    f"{DOCKER} --stop-timeout 60 --group-add 20 --device /dev/ttyUSB0 "
    '-v "$PWD:/home/lab/fleet" rcopterx up fleet/lab.toml': (DAEMON, IMAGE),
    "docker compose -f examples/two_hosts/compose.yaml up --build": (
        DAEMON,
        "tests/examples/test_compose_example.py",
    ),
    "docker compose -f examples/two_hosts/compose.yaml exec main rcopterx takeoff": (
        DAEMON,
        "tests/examples/test_compose_example.py",
    ),
    "jupyter lab examples/lab_class/exercise_sheet.ipynb": (
        "wants a browser and a student",
        "tests/examples/test_exercise_sheet.py",
    ),
    BRIDGE_TO_ROS: (OTHERS, "tests/examples/test_ros2_bridge.py"),
    f"{BRIDGE_TO_ROS} --keys ros2dds": (OTHERS, "tests/examples/test_ros2_bridge.py"),
    "rcopterx import-skybrush show.skyc show.toml": (
        "wants a show of Skybrush",
        "tests/studies/importing/test_import_skybrush.py",
    ),
    "python examples/light_show/light_show.py show.skyc --fleet show.toml --slower 2": (
        "wants a show of Skybrush",
        "tests/examples/test_flown_examples.py",
    ),
    "python -m tests.vicon_gateway.fuzz_datastream 1000000 7": (
        HOURS,
        "tests/vicon_gateway/test_fuzz_datastream.py",
    ),
    "rcopterx deploy lab.toml --wheel dist/rcopterx-*.whl --dry-run": (
        OTHERS,
        "tests/deploy/remote/test_deploy.py",
    ),
    "rcopterx new-lab lab.toml": ("asks, and somebody answers", "tests/rcopterx/test_new_lab_command.py"),
    "rcopterx new-lab test.toml": ("asks, and somebody answers", "tests/rcopterx/test_new_lab_command.py"),
    "rcopterx kill": ("is typed, and return pressed only if needed", "tests/rcopterx/test_kill.py"),
    "rcopterx calibrate h1 --step signs -f lab.toml": (RADIO, RADIOS),
    "rcopterx bind h1 -f lab.toml": (RADIO, RADIOS),
    "rcopterx bind h2 --fleet lab.toml": (RADIO, RADIOS),
    "rcopterx range-check h1 -f lab.toml": (RADIO, RADIOS),
    "rcopterx range-check h2 --seconds 60 --fleet lab.toml": (RADIO, RADIOS),
    "rcopterx calibrate h1 -f lab.toml": (RADIO, RADIOS),
    "rcopterx calibrate h2 --fleet lab.toml": (RADIO, RADIOS),
    "rcopterx bench solver --json --plot docs/figures/solver.svg": (
        "wants the libraries of other solvers",
        "tests/studies/benchmarks/test_solver_benchmark.py",
    ),
    "rcopterx fly --all --up --report out": (HOURS, "tests/integration/test_flown_manoeuvres.py"),
    "rcopterx faults --up --report faults": (HOURS, "tests/integration/test_flown_faults.py"),
    **{
        f"rcopterx experiment {words}": (HOURS, EXPERIMENTS)
        for words in (
            "formation --plot formation.png",
            "family --conditions helicopters --plot family.png",
            "hover --conditions laboratory --plot docs/figures/hover.svg",
            "formation --conditions laboratory --plot docs/figures/formation.png",
            "family --plot family.svg",
            "fleets --resume fleets.jsonl",
            "family --conditions helicopters --json --plot docs/figures/family.svg",
            "family --seeds 100,101,102,103,104,105,106,107,108,109,110,111",
            "family --conditions crazyflies",
            "fleets --conditions crazyflies",
            "family --conditions vicon_crazyflie --seeds 100,101,102,103,104,105,106,107,108,109 "
            "--knowledge default",
        )
    },
    "rcopterx arena --processes 2 --resume arena.jsonl --page arena": (
        HOURS,
        "tests/studies/arena/test_arena.py",
    ),
    "rcopterx experiment real-flights nanobench --json --plot docs/figures/real_flights.svg": (
        "wants recorded flights",
        "tests/studies/experiments/test_real_flights.py",
    ),
    "python examples/hundred.py 0.05": (HOURS, "tests/studies/benchmarks/test_scale_benchmark.py"),
    "echo '@dialout - rtprio 40' | sudo tee /etc/security/limits.d/rcopterx.conf": (
        COMPUTER,
        "tests/test_real_time_page.py",
    ),
    "sudo usermod -a -G dialout $USER": (COMPUTER, "docs/tested.md"),
    "rcopterx udev-rules | sudo tee /etc/udev/rules.d/60-rcopterx.rules": (COMPUTER, RADIOS),
    "sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=tty --subsystem-match=usb": (
        COMPUTER,
        "docs/tested.md",
    ),
}
"""Lines of pages that are not typed here: why, and what shows them instead or says that nothing does."""

INSTALLATION = re.compile(r"pip install -e (?:'(mine)\[test\]'|(examples/\w+))")
INTO_THE_COPY = r"pip install --quiet --no-deps --no-build-isolation --target plugins ./\1\2"
UP, TAKE_OFF = "rcopterx up trio", "rcopterx takeoff"
FLEETS = "fleet/fleets"
LAB = f"cp {FLEETS}/trio.toml lab.toml"
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

BY_TASK = "lab_day.md"
"""Its commands stand in tables."""

BEFORE = {
    "control.md": {
        "rcopterx tune h2 horizon": [UP, TAKE_OFF],
        "rcopterx margins": [LAB],
        "cd examples/external_control && g++": [BRIDGE, BRIDGE_LISTENS],
    },
    "crazyflie.md": {"rcopterx up lab.toml": [f"cp {FLEETS}/crazyflies.toml lab.toml"]},
    "formation.md": {"rcopterx follow h3 h2 --offset 0,-1": [UP, TAKE_OFF]},
    "ground-station.md": {"rcopterx ground": [UP]},
    "hardware.md": {
        "rcopterx calibrate h2 --step trim": [LAB, "rcopterx up lab.toml", "rcopterx takeoff h2"]
    },
    BY_TASK: {
        "rcopterx up lab.toml": [LAB],
        "rcopterx calibrate h1 --step trim": [f"{TAKE_OFF} h1"],
        "rcopterx identify": ["rcopterx up lab.toml", f"{TAKE_OFF} h1"],
    },
    "logs.md": {
        "rcopterx flights": [RECORDED, RECORDED],
        "rcopterx logs": [UP],
    },
    "mavlink.md": {"rcopterx up lab.toml": [f"cp {FLEETS}/families.toml lab.toml"]},
    "motion_capture.md": {
        "rcopterx replay-tracker": [
            LAB,
            "sed -i 's/^.tracker.$/&\\nrecord_raw = \"session.raw\"/' lab.toml",
            "rcopterx up lab.toml",
            "until [ -s session.raw ]; do sleep 0.1; done",
        ],
    },
    "multi-host.md": {
        "rcopterx host lab.toml --host main": [LAB, HOSTS, "rcopterx certs lab.toml"],
        "rcopterx up lab.toml": [DAEMONS_ANSWER],
    },
    "operations.md": {"rcopterx check": [UP, TAKE_OFF]},
    "real_firmware.md": {"rcopterx up lab.toml": [f"cp {FLEETS}/families.toml lab.toml"]},
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


SHOWN = {("tutorial.md", "rcopterx status"): "flown by mine"}
"""What a line of a page prints."""


def typed_of(page: Path) -> list[str]:
    """Everything that a page wants to be typed, in its order."""
    text = page.read_text(encoding="utf-8")
    return cells_of(text) if page.name == BY_TASK else lines_of(text)


PAGES = [page for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))) if typed_of(page)]
NEWCOMER = (ROOT / "README.md", ROOT / "docs" / "tutorial.md")
"""Read one after the other, from the first flight to a controller of one's own."""
READINGS = [NEWCOMER, *((page,) for page in PAGES if page not in NEWCOMER)]


def test_whatever_is_not_typed_is_on_a_page_and_shown_elsewhere() -> None:
    lines = {line for page in PAGES for line in typed_of(page)}
    assert set(NOT_TYPED) <= lines
    for line, (why, path) in NOT_TYPED.items():
        source = (ROOT / path).read_text(encoding="utf-8")
        assert why
        assert not line.startswith("rcopterx ") or line.split()[1] in source, f"{line}: not in {path}"


def test_what_is_done_before_a_line_belongs_to_a_line() -> None:
    for name, done in BEFORE.items():
        lines = typed_of(next(page for page in PAGES if page.name == name))
        for beginning in done:
            assert any(line.startswith(beginning) for line in lines), (name, beginning)


def meant(command: str, flights: list[str]) -> str:
    """A command with the names that stand for something put in; flights are the newest first."""
    if INSTALLATION.fullmatch(command):
        return INSTALLATION.sub(INTO_THE_COPY, command)
    names = {"FILE": 0, "FLIGHT": 0, "OTHER": 1, "trio-20261122-141500": 0}
    for name, number in names.items():
        if re.search(rf"\b{name}\b", command):
            command = re.sub(rf"\b{name}\b", flights[number], command)
    return command


@pytest.mark.campaign
@pytest.mark.integration
@pytest.mark.timeout(900)
@pytest.mark.parametrize("pages", READINGS, ids=lambda pages: "+".join(page.name for page in pages))
def test_every_command_of_pages_does_what_is_expected_of_it(pages: tuple[Path, ...], tmp_path: Path) -> None:
    with reader(tmp_path) as someone:
        for page in pages:
            type_page(page, someone)


def type_page(page: Path, someone: Reader) -> None:
    """Type what a page wants to be typed, and what its sentences say before."""
    before = dict(BEFORE.get(page.name, {}))
    for command in typed_of(page):
        for beginning in [beginning for beginning in before if command.startswith(beginning)]:
            for line in before.pop(beginning):
                someone.type(line)
        if "octave-cli" in command and shutil.which("octave-cli") is None:
            continue
        if command not in NOT_TYPED:
            printed = someone.type(meant(command, someone.flights()))
            assert SHOWN.get((page.name, command), "") in printed
    if page.name in AT_LAST:
        someone.type(AT_LAST[page.name])
