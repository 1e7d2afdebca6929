"""Every mistake in a fleet file is refused with the field, and nothing is started."""

import socket
from pathlib import Path

import msgspec
import pytest

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.deploy.hosts.resources import check_resources
from rcopterx.deploy.processes.table import processes_of
from rcopterx.fleet.reading import load_fleet, parse_fleet
from rcopterx.fleet.schema import FleetError, FleetFile

TRIO = (Path(__file__).parents[2] / "fleet" / "fleets" / "trio.toml").read_text()

HARDWARE = TRIO[: TRIO.index("\n[simulator]")] + TRIO[TRIO.index("\n[defaults.control]") :]


def refusal(text: str, directory: Path) -> str:
    with pytest.raises(FleetError) as caught:
        check_fleet(parse_fleet(text), directory)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "field", "hint"),
    [
        ("rate_hz = 50", 'rate_hz = "fast"', "simulator.rate_hz", "float"),
        ("rate_hz = 50", "rate_hz = 5", "simulator.rate_hz", ">= 20"),
        ("seed = 1", "seed = 1\n[zones.table]\nmin_m = [0, 0, 0]", "zones.table", "max_m"),
        ("seed = 1", "seed = 1\n[zones.table]\nmin_m = [0, 0, 0]\nmax_m = [1, 1, -1]",
         "zones.table.max_m[2]", "min_m[2] = 0"),
        ("seed = 1", "seed = 1\n[zones.table]\nmin_m = [0, 0, 0]\nmax_m = [100, 700, 100]",
         "zones.table.max_m[1]", "<= 100"),
        ("seed = 1", 'seed = 1\n[zones.table]\nshape = "cylinder"\nmin_m = [0, 0, 0]\nmax_m = [1, 2, 1]',
         "zones.table.max_m", "square"),
        ("seed = 1", 'seed = 1\n[zones.table]\nshape = "ball"\nmin_m = [0, 0, 0]\nmax_m = [1, 1, 1]',
         "zones.table.shape", "allowed are"),
        ("seed = 1", "sed = 1", "simulator", "`sed`, allowed are host, rate_hz, profile, seed"),
        ("seed = 1", "seed = -1", "simulator.seed", ">= 0"),
        ("heli2", "heli1", "vehicles.h2.subject", "vehicles.h1"),
        ('"radio-h2"', '"radio-h1"', "vehicles.h2.transmitter.port", "vehicles.h1"),
        ('leader = "h1", offset_m = [-0.4, 0.5', 'leader = "h7", offset_m = [-0.4, 0.5',
         "vehicles.h2.follow[0].leader", "known are"),
        ('leader = "h1", offset_m = [-0.4, 0.5', 'leader = "h2", offset_m = [-0.4, 0.5',
         "vehicles.h2.follow", "h2 cannot follow itself"),
        ("offset_m = [-0.4, 0.5, 0.0]", "offset_m = [-0.4, 0.5]", "follow", "length"),
        ('controller = "cascade"', 'controller = "magic"', "control", "allowed are"),
        ('estimator = "extended_kalman"', 'estimator = "magic"', "control", "allowed"),
        ("horizon = 50", "horizon = 1", "control.horizon", ">= 2"),
        ("horizon = 50", "horizon = 50\nsettings = { input_weights = [1.5, 1.5, 15.0, -5.0] }",
         "control", "input_weights"),
        ('subject = "heli1"', 'subject = "heli1"\ntype = "zeppelin"', "vehicles.h1.type", "coaxial"),
        ('subject = "heli1"', 'subject = "heli1"\nmodel = { lag = 1 }',
         "vehicles.h1.model.lag", "allowed are"),
        ('subject = "heli1"', 'subject = "heli1"\nhost = "attic"', "vehicles.h1.host", "main"),
        ("model_match = 2 }", 'model_match = 2, gateway = "tx9" }',
         "vehicles.h2.transmitter.gateway", "known are"),
        ("model_match = 2 }", "model_match = 2, calibration = { throttle = { us_hover = 900.0 } } }",
         "vehicles.h2.transmitter.calibration", "us_hover"),
        ("model_match = 2 }", "model_match = 2, calibration = { yaw = { trim = 9 } } }",
         "vehicles.h2.transmitter.calibration.yaw.trim", "unknown"),
        ("model_match = 2 }", 'model_match = 2, protocol = "morse" }',
         "vehicles.h2.transmitter.protocol", "morse', allowed are crazyflie, dsm2_serial, dsmp, mavlink"),
        ("model_match = 2 }", "model_match = 2, settings = { rxnum = 3 } }",
         "vehicles.h2.transmitter.settings.rxnum", "unknown field, allowed are rx_num"),
        ("model_match = 2 }", 'model_match = 2, settings = { rx_num = "3" } }',
         "vehicles.h2.transmitter.settings.rx_num", "expected `int`"),
        ("model_match = 2 }", "model_match = 2, settings = { rx_num = true } }",
         "vehicles.h2.transmitter.settings.rx_num", "expected `int`"),
        ("model_match = 2 }", "model_match = 2, settings = { rx_num = 64 } }",
         "vehicles.h2.transmitter.settings", "multi.rx_num: 64 is outside 0..63"),
        ('leader = "h1", offset_m = [-0.4, 0.5', 'leader = "h1", frame = "body", offset_m = [-0.4, 0.5',
         "vehicles.h2.follow[0].frame", "allowed are heading, inertial"),
        ("horizon = 50", "horizn = 50", "vehicles.h1.control", "`horizn`, allowed are controller, "),
        ("[vehicles.h3]", "[vehicles.H3]", "vehicles.H3", "matching regex"),
        ("rate_hz = 50", "rate_hz = 50\nstart = { H1 = [0, 0, 0, 0] }", "simulator.start", "matching regex"),
        ("model_match = 2 }", "model_match = 64 }", "model_match", "<= 63"),
        ('conditions = "helicopter"', 'conditions = "storm"', "simulator", "laboratory"),
        ("max_m = [1.2, 1.2, 2.0]", "max_m = [1.2, -1.3, 2.0]", "volume.max_m[1]", "greater"),
        ('address = "127.0.0.1:18801"', 'address = "127.0.0.1"', "tracker.address", "HOST:PORT"),
        ("[vehicles.h3]", "[vehicles.h2]", "not TOML", "h2"),
    ],
)  # fmt: skip
def test_mistake_is_refused_with_its_field_and_what_is_allowed(
    old: str, new: str, field: str, hint: str, tmp_path: Path
) -> None:
    assert old in TRIO
    message = refusal(TRIO.replace(old, new, 1), tmp_path)
    assert field in message
    assert hint in message


def test_cycle_of_leaders_is_refused_with_the_line_of_ancestors(tmp_path: Path) -> None:
    text = TRIO.replace(
        'leader = "h1", offset_m = [-0.4, 0.5', 'leader = "h3", offset_m = [-0.4, 0.5'
    ).replace('leader = "h1", offset_m = [-0.4, -0.5', 'leader = "h2", offset_m = [-0.4, -0.5')
    assert "h2 -> h3 -> h2" in refusal(text, tmp_path)


def test_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match=r"nowhere\.toml"):
        load_fleet(tmp_path / "nowhere.toml")


def test_address_in_use_is_refused_with_the_field(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        text = f"[hosts.main]\nrouter_port = {port}\n{TRIO}".replace('name = "trio"', "")
        with pytest.raises(FleetError, match=r"hosts\.main\.router_port.*in use"):
            check_resources(parse_fleet('name = "trio"\n' + text), "main", tmp_path)


def test_missing_serial_device_is_refused_when_flying_hardware(tmp_path: Path) -> None:
    free = on_free_port(parse_fleet(HARDWARE))
    with pytest.raises(FleetError, match=r"vehicles\.h1\.transmitter\.port.*no device"):
        check_resources(free, "main", tmp_path)


def on_free_port(fleet: FleetFile) -> FleetFile:
    """The same fleet with a router on a port that is free."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    host = msgspec.structs.replace(fleet.hosts["main"], router_port=port)
    return msgspec.structs.replace(fleet, hosts={"main": host})


def test_fleet_without_simulator_starts_the_same_processes_but_the_simulator() -> None:
    simulated = {spec.name for spec in processes_of(parse_fleet(TRIO), "main")}
    hardware = {spec.name for spec in processes_of(parse_fleet(HARDWARE), "main")}
    assert simulated - hardware == {"simulator"}
    assert hardware <= simulated
