"""Radios of every kind fly, and whatever happens to a transmitter leaves no vehicle uncontrolled."""

import math
import os
import pty
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from failing_gateway import FAULT
from integration_support import NAMES, Flying, Truth, fleet_text, free_port, land_gently, transmitter_state

import deploy.supervisor
from bus import channels
from bus.faults import BreakRadio, Recover
from bus.messages import Command, FloatArray
from bus.session import Session
from deploy.fleet import load_fleet
from deploy.role_settings import bus_address, calibration_of
from ground_station.scenario import inject_faults
from ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]

GENTLE_M_S = 1.7
SLOW_M_S = 0.1
THROTTLE_LOW_US = 1100
RADIOS = {"h1": "dsm2_serial", "h2": "dsmp", "h3": "ppm"}


def trio_text(radios: dict[str, str] | None = None, **options: str) -> str:
    """Fleet of three vehicles that follow nobody, with the radio of each."""
    kinds = dict.fromkeys(NAMES, "multi") | (radios or {})
    vehicles = "\n".join(
        f"""
[vehicles.{name}]
subject = "{name}"
transmitter = {{ port = "radio-{name}", model_match = {number}, protocol = "{kinds[name]}" }}
"""
        for number, name in enumerate(NAMES, 1)
    )
    start = "[simulator.start]\nh1 = [0.6, 0, 0, 0]\nh2 = [-0.4, 0.6, 0, 0]\nh3 = [-0.4, -0.6, 0, 0]"
    port = free_port()
    return fleet_text(
        free_port(), {"main": ("127.0.0.1", port)}, vehicles=vehicles, simulator=start, **options
    )


def at(truth: Truth, name: str, position_m: tuple[float, float, float], tolerance_m: float = 0.12) -> bool:
    vehicle = truth(name)
    return vehicle is not None and np.linalg.norm(np.subtract(vehicle.position_m, position_m)) < tolerance_m


@pytest.mark.campaign
def test_vehicles_with_different_radios_fly_together(launch: Launch) -> None:
    flying = launch(trio_text(RADIOS))
    assert {v.transmitter.protocol for v in load_fleet(flying.path).vehicles.values()} == set(RADIOS.values())
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.7)
    truth.start_watch()
    places = {"h1": (0.5, 0.1, 0.9), "h2": (-0.5, 0.5, 0.9), "h3": (-0.3, -0.5, 0.9)}
    for name, place in places.items():
        flying.fleet[name].go_to(place)
    flying.fleet.wait_until(
        lambda: all(at(truth, name, place) for name, place in places.items()), 15, "not all have arrived"
    )
    truth.assert_nobody_touched_down()
    land_gently(flying, truth)


class RadioLog:
    """Frames that reached the radio modules, with the time of their arrival."""

    def __init__(self, flying: Flying) -> None:
        self._inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=4096)
        self._frames: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}

    def frames(self, name: str) -> list[tuple[float, float]]:
        """Arrival time [s] and throttle [us] of all frames so far."""
        for received in self._inbox.drain():
            for unit, vehicle in received.message.vehicles.items():
                self._frames[unit] += [(frame[0], frame[1]) for frame in vehicle.radio]
        return self._frames[name]

    def throttles(self, name: str, from_s: float, until_s: float = math.inf) -> list[float]:
        """Pulse widths [us] in a time [monotonic s]."""
        return [throttle for at_s, throttle in self.frames(name) if from_s <= at_s < until_s]


def landed_gently(truth: Truth, name: str) -> bool:
    vehicle = truth(name)
    return vehicle is not None and vehicle.on_floor and vehicle.touchdown_speed_m_s < GENTLE_M_S


def counter(flying: Flying, name: str, what: str) -> int:
    status = flying.fleet.state_of(name).transmitter
    return 0 if status is None else status.counters.get(what, 0)


def all_states(flying: Flying, *states: str) -> bool:
    return all(transmitter_state(flying, name) in states for name in NAMES)


def test_vehicles_fly_on_when_their_transmitter_gateway_is_killed(launch: Launch) -> None:
    flying = launch()
    truth, log = Truth(flying), RadioLog(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    killed_s = time.monotonic()
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: all(
            counter(flying, name, "openings") == 1
            and counter(flying, name, "entered DESCEND") == counter(flying, name, "entered ARMED") == 1
            and flying.fleet.state_of(name).phase == "flying"
            for name in NAMES
        ),
        10,
        "not taken over",
    )
    assert flying.restarts("transmitters") == 1
    asked_s = time.monotonic()
    flying.fleet["h1"].go_to((0.2, 0.1, 0.9))
    flying.fleet.wait_until(lambda: at(truth, "h1", (0.2, 0.1, 0.9)), 15, "h1 does not obey any more")
    truth.assert_nobody_touched_down()
    for name in NAMES:
        assert min(log.throttles(name, killed_s, asked_s)) > THROTTLE_LOW_US + 100


@pytest.mark.campaign
def test_gateway_that_is_back_too_late_is_disarmed_and_flies_after_arming_again(
    launch: Launch, monkeypatch: pytest.MonkeyPatch
) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.6)
    monkeypatch.setattr(deploy.supervisor, "restart_pause_s", lambda _: 1.5)
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: all(on_floor(truth, name) for name in NAMES) and all_states(flying, "disarmed"),
        15,
        "not disarmed on the floor",
    )
    flying.fleet.wait_until(
        lambda: all(flying.fleet.state_of(name).phase == "ground" for name in NAMES), 5, "agents unaware"
    )
    flying.fleet.take_off(height_m=0.6)
    flying.fleet.wait_until(lambda: all(truth.height_m(name) > 0.4 for name in NAMES), 10, "not flying again")


def on_floor(truth: Truth, name: str) -> bool:
    vehicle = truth(name)
    return vehicle is not None and vehicle.on_floor


def test_sigterm_brings_everybody_down_and_ends_on_throttle_low(launch: Launch) -> None:
    flying = launch()
    truth, log = Truth(flying), RadioLog(flying)
    flying.fleet.take_off(height_m=0.8)
    terminated_s = time.monotonic()
    os.kill(flying.pid("transmitters"), signal.SIGTERM)
    flying.fleet.wait_until(
        lambda: (
            all(landed_gently(truth, name) for name in NAMES)
            and all_states(flying, "disarmed")
            and flying.restarts("transmitters") == 1
        ),
        15,
        "not landed",
    )
    for name in NAMES:
        last = log.throttles(name, terminated_s, flying.started_s("transmitters"))[-25:]
        assert [round(throttle) for throttle in last] == [THROTTLE_LOW_US] * 25


def test_exception_in_the_gateway_brings_everybody_down_and_ends_on_throttle_low(
    launch: Launch, tmp_path: Path
) -> None:
    flying = launch()
    truth, log = Truth(flying), RadioLog(flying)
    program = Path(__file__).with_name("failing_gateway.py")
    stop_supervised_gateway(flying)
    with (
        (tmp_path / "gateway.log").open("w+") as said,
        subprocess.Popen([sys.executable, program, flying.path], stderr=said) as gateway,
    ):
        try:
            flying.fleet.take_off(height_m=0.8)
            gateway.send_signal(signal.SIGUSR2)
            assert gateway.wait(10) == 1
        finally:
            gateway.kill()
        said.seek(0)
        assert FAULT in said.read()
    flying.fleet.wait_until(lambda: all(landed_gently(truth, name) for name in NAMES), 5, "not landed")
    for name in NAMES:
        last = [round(throttle) for _, throttle in log.frames(name)[-25:]]
        assert last == [THROTTLE_LOW_US] * 25


def test_sigusr1_kills_all_vehicles_of_the_gateway_and_latches(launch: Launch) -> None:
    flying = launch()
    flying.fleet.take_off(["h1", "h2"], height_m=0.3)
    os.kill(flying.pid("transmitters"), signal.SIGUSR1)
    flying.fleet.wait_until(lambda: all_states(flying, "killed"), 3, "not killed")
    with pytest.raises(RefusedError):
        flying.fleet["h3"].arm()
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: flying.restarts("transmitters") == 1 and all_states(flying, "killed"), 10, "kill forgotten"
    )


def stop_supervised_gateway(flying: Flying) -> None:
    supervisor = flying.launcher_of("transmitters").supervisor
    supervisor.children["transmitters"].wanted = False
    flying.fleet.wait_until(lambda: "transmitters" not in supervisor.running(), 10, "still runs")


@contextmanager
def gateway_on_a_terminal(flying: Flying) -> Iterator[tuple[int, subprocess.Popen[bytes]]]:
    """The gateway as a user starts it by hand, in place of the supervised one."""
    stop_supervised_gateway(flying)
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "rcopterx", "transmitters", "--fleet", str(flying.path)]
    # `setsid -c` makes the terminal the controlling one, as a shell in a window does.
    process = subprocess.Popen(["setsid", "-c", "-w", *command], stdin=slave, stdout=slave, stderr=slave)
    os.close(slave)
    try:
        yield master, process
    finally:
        os.close(master)
        process.terminate()
        process.wait(10)


def test_key_on_the_gateways_terminal_kills_and_is_explained(launch: Launch) -> None:
    flying = launch()
    with gateway_on_a_terminal(flying) as (terminal, process):
        assert "space or k" in os.read(terminal, 4096).decode()
        flying.fleet.take_off(["h1"], height_m=0.3)
        os.write(terminal, b"x")
        os.write(terminal, b" ")
        flying.fleet.wait_until(lambda: all_states(flying, "killed"), 3, "not killed")
        os.write(terminal, b"\x03")
        assert process.wait(10) == 0


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.campaign)])
def test_gateway_brings_vehicles_down_by_itself_when_the_bus_is_lost(
    launch: Launch, how: signal.Signals
) -> None:
    flying = launch()
    flying.fleet.take_off(height_m=0.8)
    flying.fleet.wait_until(steady_for(Truth(flying), 1.0), 15, "not hovering")
    supervisor = flying.launcher_of("router").supervisor
    pid = flying.pid("router")
    gateway, simulator = flying.pid("transmitters"), flying.pid("simulator")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(deploy.supervisor, "restart_pause_s", lambda _: 4.0)
        os.kill(pid, how)
        if how is signal.SIGSTOP:
            flying.fleet.wait_until(lambda: not heard_lately(flying, 4.0), 10, "the bus is not lost")
            os.kill(pid, signal.SIGCONT)
        else:
            flying.fleet.wait_until(lambda: supervisor.children["router"].restarts == 1, 10, "no new router")
    truth = Truth(flying)
    flying.fleet.wait_until(
        lambda: all(landed_gently(truth, name) for name in NAMES), 20, "not landed gently"
    )
    flying.fleet.wait_until(lambda: all_states(flying, "cut", "disarmed"), 10, "gateway not back on the bus")
    assert (flying.pid("transmitters"), flying.pid("simulator")) == (gateway, simulator)
    flying.fleet.wait_until(
        lambda: all(flying.fleet.state_of(name).phase == "ground" for name in NAMES), 10, "agents unaware"
    )
    flying.fleet.take_off(height_m=0.6)


def steady_for(truth: Truth, seconds: float) -> Callable[[], bool]:
    """Whether nobody has climbed or sunk for some time: the arbiters then know the hover thrust."""
    since_s = time.monotonic()

    def steady() -> bool:
        nonlocal since_s
        vehicles = [truth(name) for name in NAMES]
        if any(vehicle is None or abs(vehicle.velocity_m_s[2]) > SLOW_M_S for vehicle in vehicles):
            since_s = time.monotonic()
        return time.monotonic() > since_s + seconds

    return steady


def heard_lately(flying: Flying, limit_s: float) -> bool:
    ages = [flying.fleet.state_of(name).agent_age_s for name in NAMES]
    return any(age is not None and age < limit_s for age in ages)


BURST, BURST_PERIOD_S = 50, 0.01
SAFE_FALL_M = 0.12
"""A vehicle without radio falls when its receiver gives up; from here it lands at less than 1.7 m/s."""


@pytest.mark.parametrize(
    ("condition", "reported"),
    [
        ("unplugged", "No such file"),
        pytest.param("off", "module gone", marks=pytest.mark.campaign),
        pytest.param("refusing", "protocol", marks=pytest.mark.campaign),
    ],
)
def test_failed_radio_is_reported_grounds_its_vehicle_and_no_other(
    launch: Launch, condition: str, reported: str
) -> None:
    flying = launch(trio_text())
    truth = Truth(flying)
    flying.fleet.take_off(["h1", "h3"], height_m=0.8)
    flying.fleet.take_off(["h2"], height_m=SAFE_FALL_M)
    truth.start_watch()
    inject_faults(flying.fleet.session, BreakRadio("h2", condition))

    def told() -> bool:
        status = flying.fleet.state_of("h2").transmitter
        return status is not None and not status.ready and reported in status.module

    flying.fleet.wait_until(told, 10, f"{reported!r} is not reported")
    flying.fleet.wait_until(lambda: landed_gently(truth, "h2"), 10, "h2 did not come down gently")
    flying.fleet.wait_until(
        lambda: transmitter_state(flying, "h2") in ("disarmed", "cut"), 10, "h2 is not disarmed"
    )
    for name in ("h1", "h3"):
        vehicle = truth(name)
        assert vehicle is not None
        assert not vehicle.on_floor
        assert transmitter_state(flying, name) == "armed"
        assert counter(flying, name, "entered DESCEND") == 0
    inject_faults(flying.fleet.session, Recover())
    flying.fleet.wait_until(
        lambda: (status := flying.fleet.state_of("h2").transmitter) is not None and status.ready,
        10,
        "the radio is not found again",
    )
    flying.fleet.wait_until(lambda: flying.fleet.state_of("h2").phase == "ground", 10, "agent unaware")
    flying.fleet.take_off(["h2"], height_m=0.5)


def test_a_hundred_thousand_malformed_commands_are_counted_and_disturb_nobody(launch: Launch) -> None:
    flying = launch(trio_text())
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    before = {name: counter(flying, name, "entered HOLD") for name in ("h1", "h3")}
    with Session(bus_address(flying.fleet.file, "main")) as stranger:
        pauses = paced(BURST_PERIOD_S)
        for number in range(100_000):
            stranger.publish(channels.COMMAND, "h2", bad_command(number))
            if number % BURST == 0:
                next(pauses)
    # On a busy machine the bus may drop some; nothing that arrives goes uncounted.
    flying.fleet.wait_until(lambda: refused_commands(flying, "h2") > 95_000, 10, "rejections are not counted")
    flying.fleet["h2"].go_to((-0.5, 0.5, 0.9))
    flying.fleet.wait_until(lambda: at(truth, "h2", (-0.5, 0.5, 0.9)), 15, "h2 does not obey any more")
    truth.assert_nobody_touched_down()
    assert all_states(flying, "armed")
    assert {name: counter(flying, name, "entered HOLD") for name in ("h1", "h3")} == before


def paced(period_s: float) -> Iterator[None]:
    """Wait for the next tick of a period."""
    next_s = time.monotonic()
    while True:
        next_s += period_s
        time.sleep(max(0.0, next_s - time.monotonic()))
        yield


def bad_command(number: int) -> Command:
    source, thrust, sequence = (
        ("h3", 0.5, 10**15),
        ("h2", 7.0, 10**15),
        ("h2", float("nan"), 10**15),
        ("h2", 0.5, 3),
    )[number % 4]
    return Command(
        epoch=1, frame=number, source=source, sequence=sequence, input=(0.0, 0.0, thrust, 0.0),
        next_inputs=FloatArray.of(np.zeros((0, 4))), period_s=0.02,
    )  # fmt: skip


def refused_commands(flying: Flying, name: str) -> int:
    """Commands refused by the arbiter, not decodable, or pushed out before anybody read them."""
    status = flying.fleet.state_of(name).transmitter
    if status is None:
        return 0
    kinds = (
        "source without control lease",
        "old sequence number",
        "command out of limits",
        "older epoch",
        "epoch not in the raw poses",
    )
    return sum(status.counters.get(kind, 0) for kind in kinds) + sum(status.rejected.values())


@pytest.mark.campaign
def test_hover_trim_is_measured_in_flight_and_written_to_the_file(launch: Launch, tmp_path: Path) -> None:
    flying = launch(trio_text())
    copy = tmp_path / "copy.toml"
    shutil.copy(flying.path, copy)
    words = [sys.executable, "-m", "rcopterx", "calibrate", "h2", "--step", "trim", "--seconds", "3"]
    refused = subprocess.run([*words, "--fleet", str(copy)], capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "hover first" in refused.stderr
    flying.fleet.take_off(["h2"], height_m=0.8)
    flying.fleet.wait_for_arrival(["h2"])
    in_flight = subprocess.run(
        [*words[:5], "--pitch", "reversed", "--fleet", str(copy)], capture_output=True, text=True, check=False
    )
    assert in_flight.returncode == 1
    assert "land the fleet" in in_flight.stderr
    done = subprocess.run([*words, "--fleet", str(copy)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    calibration = calibration_of(load_fleet(copy).vehicles["h2"], "h2")
    trimmed = any(channel.trim_us for channel in (calibration.pitch, calibration.roll, calibration.yaw))
    assert trimmed != ("all below" in done.stdout)
    assert transmitter_state(flying, "h2") == "armed"
