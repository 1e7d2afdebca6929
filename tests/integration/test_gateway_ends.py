"""However a transmitter gateway ends, or the bus it is on: vehicles fly on, or land gently and stay cut."""

import math
import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from failing_gateway import FAULT
from integration_support import (
    NAMES,
    THROTTLE_LOW_US,
    Flying,
    RadioLog,
    Truth,
    all_states,
    at,
    counter,
    landed_gently,
    on_floor,
)

import deploy.supervisor
from ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


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
            and counter(flying, name, "entered LAND") == counter(flying, name, "entered ARMED") == 1
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


def test_vehicles_whose_agents_never_come_back_land_where_they_were(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=1.0)
    flying.fleet.wait_until(truth.rested, 15, "not hovering")
    truth.start_watch()
    places = {name: vehicle.position_m for name in NAMES if (vehicle := truth(name)) is not None}
    for name in NAMES:
        supervisor = flying.launcher_of(f"agent-{name}").supervisor
        pid = flying.pid(f"agent-{name}")
        supervisor.children[f"agent-{name}"].wanted = False
        os.kill(pid, signal.SIGKILL)
    flying.fleet.wait_until(
        lambda: all(on_floor(truth, name) for name in NAMES) and all_states(flying, "cut"), 15, "not landed"
    )
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        assert vehicle.touchdown_speed_m_s < 0.6
        assert math.dist(vehicle.position_m[:2], places[name][:2]) < 0.3
        assert counter(flying, name, "entered DESCEND") == 0


def test_vehicles_whose_agents_hang_for_two_seconds_are_flown_again(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=1.2)
    flying.fleet.wait_until(truth.rested, 15, "not hovering")
    truth.start_watch()
    pids = [flying.pid(f"agent-{name}") for name in NAMES]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    hung_s = time.monotonic()
    flying.fleet.wait_until(lambda: time.monotonic() > hung_s + 2.0, 5, "no time passes")
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)
    flying.fleet.wait_until(
        lambda: all_states(flying, "armed") and truth.rested(),
        15,
        "not flown again",
        NAMES,
    )
    truth.assert_nobody_touched_down()


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
    flying.fleet.wait_until(Truth(flying).rested, 15, "not hovering")
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


def heard_lately(flying: Flying, limit_s: float) -> bool:
    ages = [flying.fleet.state_of(name).agent_age_s for name in NAMES]
    return any(age is not None and age < limit_s for age in ages)
