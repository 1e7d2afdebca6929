"""Promises of joining a fleet: it is the one that is up, and never another one than the one named."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from support.bus import Child, own_address
from support.scripted import fleet_file_text
from support.waiting import DEADLINE_S

from rcopterx.bus.session import BusAddress
from rcopterx.fleet.reading import load_fleet, parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.joining import WrongFleetError, fleet_that_is_up

ROLE = """
import json, sys
from pathlib import Path
from rcopterx.fleet.reading import load_fleet
from rcopterx.deploy.roles.run import run_role
run_role("router", "main", load_fleet(Path(sys.argv[1])))
"""


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "run"))


@contextmanager
def router_of(path: Path) -> Iterator[None]:
    """The router of a fleet file, as the launcher runs it."""
    child = Child(ROLE, str(path))
    try:
        Fleet(load_fleet(path), timeout_s=DEADLINE_S).close()
        yield
    finally:
        child.end()


def written(tmp_path: Path, name: str = "lab", address: BusAddress | None = None, vehicles: int = 2) -> Path:
    names = tuple(f"h{number}" for number in range(1, vehicles + 1))
    text = fleet_file_text(address or own_address(), names).replace('name = "lab"', f'name = "{name}"')
    path = tmp_path / f"{name}.toml"
    path.write_text(text)
    return path


def test_the_fleet_that_is_up_is_joined_without_naming_it(tmp_path: Path) -> None:
    path = written(tmp_path)
    with router_of(path):
        file = load_fleet(path)
        path.write_text("broken meanwhile")
        with Fleet.connect() as fleet:
            assert fleet.file == file


def test_without_a_fleet_it_is_said_how_to_start_or_name_one() -> None:
    with pytest.raises(FleetError, match=r"no fleet is up on this computer; start one \(rcopterx up FLEET\)"):
        Fleet.connect()


def test_of_several_fleets_one_must_be_named(tmp_path: Path) -> None:
    with ExitStack() as stack:
        for name in ("attic", "lab"):
            stack.enter_context(router_of(written(tmp_path, name)))
        with pytest.raises(FleetError, match="several fleets are up: attic, lab; name the file of one"):
            fleet_that_is_up()


def test_a_fleet_of_another_name_at_the_same_address_is_refused_and_named(tmp_path: Path) -> None:
    address = own_address()
    other = load_fleet(written(tmp_path, "attic", address))
    with (
        router_of(written(tmp_path, "lab", address)),
        pytest.raises(WrongFleetError, match=r"^fleet lab \(h1, h2\) is up at this address, not attic"),
    ):
        Fleet(other, timeout_s=DEADLINE_S)


def test_another_version_of_the_file_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    changed = parse_fleet(path.read_text() + "\n[avoidance]\nenabled = false\n")
    with (
        router_of(path),
        pytest.raises(WrongFleetError, match=r"^fleet lab is up with another version of its file \(\w{12}"),
    ):
        Fleet(changed, timeout_s=DEADLINE_S)


def test_another_version_of_the_file_of_a_hundred_vehicles_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, vehicles=100)
    changed = parse_fleet(path.read_text() + "\n[avoidance]\nenabled = false\n")
    with router_of(path), pytest.raises(WrongFleetError, match="another version of its file"):
        Fleet(changed, timeout_s=DEADLINE_S)


def test_the_record_of_a_fleet_can_be_read_by_other_programs(tmp_path: Path) -> None:
    with router_of(written(tmp_path)):
        (record,) = (tmp_path / "run").glob("*/up-main.json")
        assert json.loads(record.read_text())["vehicles"] == ["h1", "h2"]


def test_programs_that_join_a_fleet_use_its_clock(tmp_path: Path) -> None:
    path = written(tmp_path)
    file = parse_fleet(path.read_text() + "[simulator]\n")
    path.write_text(path.read_text() + "[simulator]\nspeed = 0.5\n")
    with router_of(path), Fleet(file, timeout_s=DEADLINE_S) as by_name, Fleet.connect() as found:
        assert by_name.file == found.file == load_fleet(path)
        before_s = time.monotonic()
        now_s = by_name.session.clock()
        assert before_s - 0.01 <= now_s / 0.5 <= time.monotonic()


def test_a_program_that_waits_for_a_fleet_to_come_up_uses_its_clock(tmp_path: Path) -> None:
    path = written(tmp_path)
    file = parse_fleet(path.read_text() + "[simulator]\n")
    path.write_text(path.read_text() + "[simulator]\nspeed = 0.5\n")
    child = Child(ROLE, str(path))
    try:
        # It reads the record before the router has started, which takes longer than a second.
        with Fleet(file, timeout_s=DEADLINE_S) as fleet:
            assert fleet.file == load_fleet(path)
    finally:
        child.end()
