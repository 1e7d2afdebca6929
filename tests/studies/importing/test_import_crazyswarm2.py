"""Promises of `rcopterx import`: what other software flew becomes a fleet file; none is overwritten."""

from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import battery_of
from rcopterx.radios.battery import BatteryLimits

FIXTURES = Path(__file__).parents[2] / "fixtures"
CRAZYFLIES = """
robots:
  C04: {enabled: false, uri: "radio://0/80/1M/E7E7E7E704", initial_position: [1, 0, 0], type: C10X}
  C23:
    enabled: true
    uri: radio://0/80/2M/E7E7E7E717
    initial_position: [0.2, 0.0, 0.0]
    type: C10X
    role: evader
  24-b:
    uri: radio://0/80/2M/E7E7E7E718
    initial_position: [-0.3, 0.5, 0.0]
robot_types: {C10X: {big_quad: false, battery: {voltage_warning: 3.8, voltage_critical: 3.7}}}
all: {firmware_params: {commander: {enHighLevel: 1}}}
"""
TRACKER = """
/motion_capture_tracking:
  ros__parameters:
    type: "vicon"
    hostname: "192.168.2.15"
    topics: {poses: {qos: {mode: "sensor"}}}
"""


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A configuration of Crazyswarm2."""
    (tmp_path / "motion_capture.yaml").write_text(TRACKER)
    path = tmp_path / "crazyflies.yaml"
    path.write_text(CRAZYFLIES)
    return path


def imported(*arguments: str | Path) -> Result:
    words = ["import", "crazyswarm2", *map(str, arguments)]
    result = CliRunner().invoke(app, words, env={"COLUMNS": "300", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_enabled_robots_become_a_fleet_with_the_same_radios_and_tracker(source: Path) -> None:
    path = source.with_name("my-lab.toml")
    result = imported(source, path)
    assert result.exit_code == 0, result.stderr
    fleet = load_fleet(path)
    assert fleet.name == "my_lab"
    assert (fleet.tracker.brand, fleet.tracker.address) == ("vicon", "192.168.2.15:801")
    assert {name: (one.subject, one.type) for name, one in fleet.vehicles.items()} == {
        "c23": ("C23", "crazyflie"),
        "cf24_b": ("24-b", "crazyflie"),
    }
    assert fleet.vehicles["c23"].transmitter.port == "radio://0/80/2M/E7E7E7E717"


def test_the_voltages_of_a_type_of_robots_limit_its_flights(source: Path) -> None:
    path = source.with_name("lab.toml")
    assert imported(source, path).exit_code == 0
    fleet = load_fleet(path)
    assert battery_of(fleet, "c23") == BatteryLimits(3.8, 3.7, 4.2, 420.0)
    assert battery_of(fleet, "cf24_b") == BatteryLimits(3.2, 3.0, 4.2, 420.0), "those of the type crazyflie"


def test_the_formation_keeps_the_distances_of_the_initial_positions(source: Path) -> None:
    path = source.with_name("lab.toml")
    imported(source, path)
    path.write_text(path.read_text().replace("# follow", "follow"))
    (link,) = load_fleet(path).vehicles["cf24_b"].follow
    assert (link.leader, link.offset_m) == ("c23", (-0.5, 0.5, 0.0))


def test_the_next_steps_name_no_binding_and_calibration(source: Path) -> None:
    path = source.with_name("lab.toml")
    imported(source, path)
    assert f"rcopterx up {path}" in path.read_text()
    assert "calibrate" not in path.read_text()


def test_another_motion_capture_needs_its_rate(source: Path) -> None:
    tracker = source.with_name("motive.yaml")
    tracker.write_text(TRACKER.replace("vicon", "optitrack"))
    path = source.with_name("lab.toml")
    refused = imported(source, path, "--motion-capture", tracker)
    assert refused.exit_code == 2
    assert "tracker.rate_hz" in refused.stderr
    assert not path.exists()
    assert imported(source, path, "--motion-capture", tracker, "--rate", "100").exit_code == 0
    assert load_fleet(path).tracker.rate_hz == 100.0
    assert load_fleet(path).tracker.address == "192.168.2.15:1510"


def test_existing_fleet_file_is_kept(source: Path) -> None:
    path = source.with_name("lab.toml")
    path.write_text("mine")
    result = imported(source, path)
    assert result.exit_code == 2
    assert "exists already" in result.stderr
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("crazyflies.yaml", "robots: [", "crazyflies.yaml"),
        (
            "crazyflies.yaml",
            "robots: {C1: {enabled: true}}",
            "robots.C1: object missing required field `uri`",
        ),
        ("crazyflies.yaml", "robots: {C1: 5}", "robots.C1: expected `object`, got `int`"),
        (
            "crazyflies.yaml",
            "robots: {C1: {uri: x, initial_position: [0,4, 0, 0]}}",
            "robots.C1.initial_position",
        ),
        ("crazyflies.yaml", "crazyflies: [{id: 1, channel: 80}]", "a file of Crazyswarm 1"),
        ("crazyflies.yaml", "robots: {C1: {uri: 5}}", "robots.C1.uri: expected `str`, got `int`"),
        ("crazyflies.yaml", "robots: {C1: {uri: x, enabled: false}}", "no robot is enabled"),
        (
            "crazyflies.yaml",
            "robots: {C1: {uri: 'udp://a:1'}, c1: {uri: 'udp://a:2'}}",
            "differ only in capital letters",
        ),
        ("crazyflies.yaml", "robots: {C1: {uri: radio}}", "robots.C1.uri: 'radio' is no address"),
        (
            "crazyflies.yaml",
            "robots: {C1: {uri: radio://0/80/2M/E7E7E7E701}, C2: {uri: radio://0/80/2M/E7E7E7E701}}",
            "robots.C2.uri: 'radio://0/80/2M/E7E7E7E701' is already that of robots.C1",
        ),
        (
            "crazyflies.yaml",
            CRAZYFLIES.replace("warning: 3.8", "warning: 3.6"),
            "robot_types.C10X.battery: voltage_warning must be at least voltage_critical",
        ),
        (
            "motion_capture.yaml",
            TRACKER.replace("192.168.2.15", "192.168.2.15:801:801"),
            "hostname: '192.168.2.15:801:801' is neither a name nor an address",
        ),
        ("motion_capture.yaml", "{}", "/motion_capture_tracking"),
        ("motion_capture.yaml", TRACKER.replace("vicon", "nokov"), "type 'nokov': allowed are vicon"),
        ("motion_capture.yaml", TRACKER.replace("192.168.2.15", ""), "hostname: is missing"),
        ("motion_capture.yaml", None, "motion_capture.yaml: cannot be read"),
    ],
)
def test_what_cannot_be_used_is_named(source: Path, name: str, text: str | None, words: str) -> None:
    changed = source.with_name(name)
    changed.unlink()
    if text is not None:
        changed.write_text(text)
    path = source.with_name("lab.toml")
    result = imported(source, path)
    assert result.exit_code == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not path.exists()


REMARKS = {
    "tracking_points": "robots.cf1: tracking 'librigidbodytracker', from single markers, is not taken over",
    "big_quad": "robots.cf1: big_quad is not taken over",
    "dup_key": "crazyflies.yaml: robots.cf1 is there twice, in lines 3 and 8: only the last one",
    "mc_port": "motion_capture.yaml: hostname '192.0.2.7:801' gives the port already: it is used",
    "pos_nan": "robots.cf2.initial_position: is not finite",
}


@pytest.mark.parametrize("case", REMARKS)
def test_everything_that_is_not_taken_over_is_a_remark_that_names_the_robot(
    case: str, tmp_path: Path
) -> None:
    path = tmp_path / "lab.toml"
    result = imported(FIXTURES / "import_crazyswarm2" / case / "crazyflies.yaml", path)
    assert result.exit_code == 0, result.stderr
    assert f"remark: {REMARKS[case]}" in result.stderr
    assert load_fleet(path).tracker.address == "192.0.2.7:801"


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("enabled_str", "robots.cf1.enabled: expected `bool`, got `str`"),
        ("crazyswarm1", "a file of Crazyswarm 1"),
    ],
)
def test_robots_that_cannot_be_used_are_named(case: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    result = imported(FIXTURES / "import_crazyswarm2" / case / "crazyflies.yaml", path)
    assert result.exit_code == 2
    assert words in result.stderr
    assert not path.exists()


@pytest.mark.parametrize(
    ("uri", "remark"),
    [
        ("radio://*/80/2M/E7E7E7E717", "robots.C23.uri: any dongle is not taken over, number 0 is used"),
        ("radio://0/80/2M/E7E7E7E717?safelink=1", "robots.C23.uri: safelink=1 not taken over"),
    ],
)
def test_parts_of_an_address_that_a_fleet_file_has_not_are_remarks(
    source: Path, uri: str, remark: str
) -> None:
    source.write_text(CRAZYFLIES.replace("radio://0/80/2M/E7E7E7E717", f"'{uri}'"))
    path = source.with_name("lab.toml")
    assert f"remark: {remark}" in imported(source, path).stderr
    assert load_fleet(path).vehicles["c23"].transmitter.port == "radio://0/80/2M/E7E7E7E717"


def test_robots_that_start_at_one_place_are_a_remark(source: Path) -> None:
    source.write_text(CRAZYFLIES.replace("[-0.3, 0.5, 0.0]", "[0.2, 0.0, 0.0]"))
    result = imported(source, source.with_name("lab.toml"))
    assert "remark: robots.24-b.initial_position: is that of robots.C23; set offset_m" in result.stderr


@pytest.mark.parametrize(
    ("hostname", "address"),
    [("fe80::1", "[fe80::1]:801"), ("'[fe80::1]:802'", "[fe80::1]:802"), ("lab-pc:802", "lab-pc:802")],
)
def test_addresses_of_a_motion_capture_may_be_of_any_kind(source: Path, hostname: str, address: str) -> None:
    source.with_name("motion_capture.yaml").write_text(TRACKER.replace('"192.168.2.15"', hostname))
    path = source.with_name("lab.toml")
    assert imported(source, path).exit_code == 0
    assert load_fleet(path).tracker.address == address


def test_keys_that_no_fleet_file_has_are_remarks(source: Path) -> None:
    result = imported(source, source.with_name("lab.toml"))
    assert "remark: robots.C23: role not taken over" in result.stderr
    assert "remark: all: firmware_params not taken over" in result.stderr
