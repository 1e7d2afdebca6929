"""Promises of starting a host: what is in use or missing is named, and nothing has been started then."""

import errno
import os
import pty
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.bus import free_port
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.bus.clock import Clock
from rcopterx.bus.processes import ROLES
from rcopterx.bus.session import BusUnreachableError
from rcopterx.deploy.hosts.launcher import Launcher, call_in_realtime, stretched
from rcopterx.deploy.hosts.resources import check_resources
from rcopterx.deploy.hosts.run_directory import router_socket, run_directory, serial_path
from rcopterx.deploy.hosts.running import RunningFleet, recorded
from rcopterx.deploy.processes.table import processes_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError, WatchdogConfig

TWO_HOSTS = (
    PAIR
    + 'host = "second"\n[hosts.main]\n[hosts.second]\naddress = "127.0.0.2"\n'
    + '[gateways.transmitters]\n[gateways.spare_room]\nhost = "second"\n'
)


def on_free_ports(text: str) -> str:
    return (
        text + f'\n[hosts.main]\nrouter_port = {free_port()}\n[tracker]\naddress = "127.0.0.1:{free_port()}"'
    )


def names(text: str, host: str) -> list[str]:
    return [spec.name for spec in processes_of(parse_fleet(text), host)]


def test_one_host_runs_everything_in_starting_order() -> None:
    specs = processes_of(parse_fleet(PAIR), "main")
    assert [(spec.name, spec.role, spec.unit) for spec in specs] == [
        ("router", "router", "main"),
        ("recorder", "recorder", "main"),
        ("learner", "learner", "main"),
        ("simulator", "simulator", "main"),
        ("tracker", "tracker", "main"),
        ("transmitters", "transmitters", "transmitters"),
        ("agent-h1", "agent", "h1"),
        ("agent-h2", "agent", "h2"),
    ]
    stopped = [spec.name for spec in sorted(specs, key=lambda spec: ROLES[spec.role].stop_order)]
    assert stopped == [
        "learner", "agent-h1", "agent-h2", "transmitters", "tracker", "simulator", "recorder", "router",
    ]  # fmt: skip


IDENTIFIED = "uncertainty = { gain_factor = [1.3, 1.3, 1.3], delay_s = [0.015, 0.015, 0.015] }"


@pytest.mark.parametrize(
    ("text", "learns"),
    [
        (PAIR, True),
        (HARDWARE_PAIR, True),
        ("learning = false\n" + PAIR, False),
        (PAIR + "learning = false\n", True),
        (PAIR + "[defaults]\nlearning = false\n", False),
        (PAIR.replace("[simulator]", "[simulator]\nlockstep = true"), False),
        ("learning = true\n" + PAIR.replace("[simulator]", "[simulator]\nlockstep = true"), True),
        (PAIR + f"[defaults.model]\n{IDENTIFIED}\n", False),
        (PAIR + "[hosts.main]\nsteering = false\n", False),
    ],
)
def test_a_learner_runs_where_a_vehicle_learns_and_its_host_may_steer(text: str, learns: bool) -> None:
    assert ("learner" in names(text, "main")) == learns


def test_a_fleet_that_flies_hardware_runs_no_simulator() -> None:
    assert "simulator" not in names(HARDWARE_PAIR, "main")


def test_every_process_runs_on_its_host_and_each_host_has_a_router() -> None:
    assert names(TWO_HOSTS, "main") == [
        "router", "recorder", "learner", "simulator", "tracker", "transmitters", "agent-h1",
    ]  # fmt: skip
    assert names(TWO_HOSTS, "second") == ["router", "agent-h2"]


def test_in_slow_motion_processes_may_be_silent_and_land_for_longer() -> None:
    limits = WatchdogConfig()
    assert stretched(limits, Clock()) == limits
    slow = stretched(limits, Clock(0.2))
    assert (slow.flight_s, slow.floor_s, slow.start_s) == (
        pytest.approx(5 * limits.flight_s),
        pytest.approx(5 * limits.floor_s),
        limits.start_s,
    )
    assert stretched(limits, Clock(4.0)) == limits, "a process needs as much real time as ever"
    (real,) = (spec.landing_s for spec in processes_of(parse_fleet(PAIR), "main") if spec.landing_s)
    slower = parse_fleet(PAIR.replace("[simulator]", "[simulator]\nspeed = 0.2"))
    assert max(spec.landing_s for spec in processes_of(slower, "main")) == pytest.approx(5 * real)


def test_an_unknown_host_is_refused() -> None:
    with pytest.raises(FleetError, match="unknown host 'roof', known are main"):
        processes_of(parse_fleet(PAIR), "roof")


@pytest.mark.parametrize(
    ("field", "port_of"), [("hosts.main.router_port", "router"), ("tracker.address", "tracker")]
)
def test_an_address_in_use_is_refused_by_its_field(
    field: str, port_of: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        taken = busy.getsockname()[1]
        ports = {"router": free_port(), "tracker": free_port()} | {port_of: taken}
        text = PAIR + f'[tracker]\naddress = "127.0.0.1:{ports["tracker"]}"\n'
        text += f"[hosts.main]\nrouter_port = {ports['router']}"
        with pytest.raises(
            FleetError, match=rf"^{field}: 127\.0\.0\.1:{taken} cannot be used: .*already up\?"
        ):
            Launcher(parse_fleet(text), "main")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_fleet_that_is_up_is_not_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    fleet = parse_fleet(PAIR)
    directory = run_directory(fleet.name, None)
    running = RunningFleet(fleet.name, "", None, "main", [], [], [], "")
    with recorded(directory, running), pytest.raises(FleetError, match="already up on this computer"):
        check_resources(fleet, "main", directory)
    check_resources(fleet, "main", directory)


def test_a_recording_that_cannot_be_created_is_refused_on_the_host_that_records(tmp_path: Path) -> None:
    hosts = f"[hosts.main]\nrouter_port = {free_port()}\n[hosts.roof]\nrouter_port = {free_port()}\n"
    fleet = parse_fleet(f'{PAIR}{hosts}[tracker]\nrecord_raw = "{tmp_path}"')
    with pytest.raises(FleetError, match=rf"^tracker\.record_raw: {tmp_path} is a directory"):
        check_resources(fleet, "main", tmp_path)
    check_resources(fleet, "roof", tmp_path)


def test_a_brand_whose_library_is_missing_is_refused_with_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.vicon_gateway.brands.find_spec", lambda _: None)
    text = PAIR + f'[hosts.main]\nrouter_port = {free_port()}\n[tracker]\nbrand = "vicon_sdk"\nrate_hz = 50'
    with pytest.raises(FleetError, match=r"^tracker\.brand: 'vicon_sdk': .*pip install 'rcopterx\[mocap\]'"):
        check_resources(parse_fleet(text), "main", tmp_path)


def test_an_address_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    text = PAIR + '[hosts.main]\naddress = "192.0.2.77"\n[security]\ninsecure = true'
    with pytest.raises(
        FleetError, match=r"^hosts\.main\.router_port: 192\.0\.2\.77:7447 cannot be used: [^;]*$"
    ):
        check_resources(parse_fleet(text), "main", tmp_path)


def test_a_tracker_on_another_machine_needs_no_free_port_here(tmp_path: Path) -> None:
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        (tmp_path / "radio-h1").touch()
        (tmp_path / "radio-h2").touch()
        address = f'[tracker]\naddress = "127.0.0.1:{busy.getsockname()[1]}"'
        text = HARDWARE_PAIR + f"[hosts.main]\nrouter_port = {free_port()}\n" + address
        check_resources(parse_fleet(text), "main", tmp_path)


@pytest.fixture
def port() -> Iterator[str]:
    """A serial device that is there."""
    master, slave = pty.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_missing_serial_device_is_reported_and_keeps_no_other_vehicle_on_the_floor(
    tmp_path: Path, port: str
) -> None:
    text = HARDWARE_PAIR.replace("radio-h1", port).replace("radio-h2", "/dev/ttyNONE9")
    (line,) = check_resources(
        parse_fleet(text + f"[hosts.main]\nrouter_port = {free_port()}"), "main", tmp_path
    )
    assert line.startswith("vehicles.h2.transmitter.port: there is no device /dev/ttyNONE9")
    assert line.endswith("the others fly without it")


def test_missing_serial_devices_of_all_vehicles_are_refused_by_their_fields(tmp_path: Path) -> None:
    text = HARDWARE_PAIR.replace("radio-h1", "/dev/ttyNONE8").replace("radio-h2", "/dev/ttyNONE9")
    fleet = parse_fleet(text + f"[hosts.main]\nrouter_port = {free_port()}")
    with pytest.raises(
        FleetError, match=r"^vehicles\.h1\..*ttyNONE8; vehicles\.h2\.transmitter\.port: there is no device"
    ):
        check_resources(fleet, "main", tmp_path)
    with pytest.raises(FleetError, match=r"^vehicles\.h2\.transmitter\.port"):
        check_resources(fleet, "main", tmp_path, without=["h1"])


def test_vehicles_that_are_left_out_need_no_device(tmp_path: Path, port: str) -> None:
    text = HARDWARE_PAIR.replace("radio-h1", port).replace("radio-h2", "/dev/ttyNONE9")
    fleet = parse_fleet(text + f"[hosts.main]\nrouter_port = {free_port()}")
    assert check_resources(fleet, "main", tmp_path, without=["h2"]) == []


@pytest.mark.parametrize(
    ("without", "words"),
    [
        (["h9"], "--without: unknown vehicle 'h9', known are h1, h2"),
        (["h1", "h2"], "--without: at least one vehicle must take part"),
    ],
)
def test_all_vehicles_and_unknown_ones_cannot_be_left_out(
    without: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with pytest.raises(FleetError, match=words):
        Launcher(parse_fleet(on_free_ports(PAIR)), "main", without)


def test_serial_devices_of_other_hosts_are_not_looked_for(tmp_path: Path) -> None:
    hosts = f'\n[hosts.main]\nrouter_port = {free_port()}\n[hosts.roof]\naddress = "127.0.0.2"\n'
    text = HARDWARE_PAIR + hosts + '[gateways.transmitters]\nhost = "roof"'
    check_resources(parse_fleet(text), "main", tmp_path)


def test_a_wrong_file_stops_the_start_before_any_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    text = on_free_ports(PAIR + 'control = { controller = "x" }')
    with pytest.raises(FleetError, match=r"vehicles\.h2\.control"):
        Launcher(parse_fleet(text), "main")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_the_run_directory_is_where_the_user_says_else_where_the_system_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "mine"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert run_directory("lab", None) == tmp_path / "mine" / "lab"
    assert (tmp_path / "mine" / "lab" / "log").is_dir()
    monkeypatch.delenv("RCOPTERX_RUN")
    assert run_directory("lab", "t1") == tmp_path / "rcopterx" / "lab-t1"
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert run_directory("lab", None) == tmp_path / f"rcopterx-{os.getuid()}" / "lab"


@pytest.mark.parametrize("call", ["fcntl.flock", "os.fsync"], ids=["no locks", "full"])
def test_the_run_directory_is_in_the_next_place_where_files_cannot_be_stored_or_locked(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.delenv("RCOPTERX_RUN", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(call, refuse)
    assert run_directory("lab", None) == tmp_path / f"rcopterx-{os.getuid()}" / "lab"


def test_fleets_of_other_names_and_namespaces_keep_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    directories = {run_directory(*names) for names in (("a", None), ("a", "b"), ("b", None))}
    assert len(directories) == 3


def test_relative_serial_ports_live_in_the_run_directory(tmp_path: Path) -> None:
    assert serial_path("radio-h1", tmp_path) == tmp_path / "radio-h1"
    assert serial_path("/dev/ttyUSB0", tmp_path) == Path("/dev/ttyUSB0")


def test_a_router_has_a_socket_only_where_its_path_is_short_enough() -> None:
    assert router_socket("main", Path("/run/x")) == "unixsock-stream//run/x/router-main.sock"
    assert router_socket("main", Path("/run") / ("x" * 100)) is None


def test_a_fleet_file_sets_the_limits_of_the_watchdog() -> None:
    patient = parse_fleet(PAIR + "[watchdog]\nflight_s = 0.3\nfloor_s = 2\nstart_s = 60").watchdog
    assert (patient.flight_s, patient.floor_s, patient.start_s) == (0.3, 2.0, 60.0)
    with pytest.raises(FleetError, match=r"watchdog\.flight_s"):
        parse_fleet(PAIR + "[watchdog]\nflight_s = 0.01")


@pytest.mark.parametrize(
    ("option", "table", "watches"),
    [(True, "", True), (False, "", False), (True, "[watchdog]\nenabled = false\n", False)],
)
def test_a_launcher_watches_unless_that_is_switched_off(
    option: bool, table: str, watches: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    monkeypatch.setattr("rcopterx.deploy.hosts.launcher.check_in_process", lambda *_: None)
    launcher = Launcher(parse_fleet(on_free_ports(PAIR + table)), "main", watchdog=option)
    try:
        assert launcher.supervisor.watchdog_on is watches
    finally:
        launcher.supervisor.stop_all()


def test_a_call_in_real_time_is_made_in_a_thread_of_that_class(monkeypatch: pytest.MonkeyPatch) -> None:
    requests: list[tuple[int, int]] = []
    monkeypatch.setattr(
        "rcopterx.deploy.hosts.launcher.request_realtime",
        lambda priority: requests.append((threading.get_ident(), priority)),
    )
    called_by = call_in_realtime(24, threading.get_ident)
    assert requests == [(called_by, 24)]
    assert called_by != threading.get_ident()


def test_a_call_in_real_time_that_fails_raises_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.deploy.hosts.launcher.request_realtime", lambda _: False)

    def fail() -> None:
        raise BusUnreachableError("no router")

    with pytest.raises(BusUnreachableError, match="no router"):
        call_in_realtime(0, fail)
