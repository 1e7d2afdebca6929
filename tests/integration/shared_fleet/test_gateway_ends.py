"""However a transmitter gateway ends, or the bus it is on: vehicles fly on, or land gently and stay cut."""

import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from failing_gateway import FAULT
from integration_support import (
    NAMES,
    THROTTLE_LOW_US,
    Flying,
    Truth,
    all_states,
    counter,
    flown_by,
    fly_to,
    landed_gently,
    on_floor,
)
from radio_support import RadioLog

import rcopterx.deploy.processes.supervisor
from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]


@pytest.mark.lockstep
def test_vehicles_fly_on_when_their_transmitter_gateway_is_killed(flying: Flying, truth: Truth) -> None:
    log, restarts = RadioLog(flying), flying.restarts("transmitters")
    flying.wait_for_spare("transmitters")
    killed_s = flying.now_s()
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: (
            flying.restarts("transmitters") == restarts + 1
            # Another gateway's counters begin at zero: it has opened the port once and taken over in flight.
            and all(counter(flying, name, "openings") == 1 for name in NAMES)
            and all(
                counter(flying, name, "entered DESCEND") + counter(flying, name, "entered LAND") >= 1
                for name in NAMES
            )
            and all(flown_by(flying, name) is not None for name in NAMES)
        ),
        30,
        "not taken over",
        NAMES,
    )
    fly_to(flying, truth, (0.2, 0.1, 0.9))
    truth.assert_none_touched_down()
    for name in NAMES:
        assert min(log.throttles(name, killed_s)) > THROTTLE_LOW_US + 100


@pytest.mark.campaign
def test_gateway_that_is_back_too_late_is_disarmed_and_flies_after_arming_again(
    flying: Flying, truth: Truth, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rcopterx.deploy.processes.supervisor, "restart_pause_s", lambda _: 1.5)
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: all(on_floor(truth, name) for name in NAMES) and all_states(flying, "disarmed"),
        30,
        "not disarmed on the floor",
    )
    flying.fleet.wait_until(
        lambda: all(flying.fleet.state_of(name).phase == "ground" for name in NAMES), 30, "agents unaware"
    )
    flying.fleet.take_off(height_m=0.6, timeout_s=40)
    flying.fleet.wait_until(lambda: all(truth.height_m(name) > 0.4 for name in NAMES), 30, "not flying again")


@pytest.mark.lockstep
def test_sigusr1_kills_all_vehicles_of_the_gateway_and_latches(flying: Flying) -> None:
    restarts = flying.restarts("transmitters")
    os.kill(flying.pid("transmitters"), signal.SIGUSR1)
    flying.fleet.wait_until(lambda: all_states(flying, "killed"), 30, "not killed", NAMES)
    with pytest.raises(RefusedError):
        flying.fleet["h3"].arm()
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: (
            flying.restarts("transmitters") == restarts + 1
            and all(counter(flying, name, "openings") == 1 for name in NAMES)
            and all_states(flying, "killed")
        ),
        30,
        "kill forgotten",
        NAMES,
    )


def stop_supervised_gateway(flying: Flying) -> None:
    supervisor = flying.launcher_of("transmitters").supervisor
    supervisor.children["transmitters"].wanted = False
    flying.fleet.wait_until(lambda: "transmitters" not in supervisor.running(), 30, "still runs")


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


def read_until(terminal: int, wanted: str, timeout_s: float = 20.0) -> None:
    """Read what a terminal shows until some text has come."""
    text, deadline_s = "", time.monotonic() + timeout_s
    while wanted not in text:
        readable, _, _ = select.select([terminal], [], [], max(0.0, deadline_s - time.monotonic()))
        assert readable, f"no {wanted!r} in {text!r}"
        text += os.read(terminal, 4096).decode()


def test_key_on_the_gateways_terminal_kills_and_is_explained(grounded: Flying) -> None:
    flying = grounded
    with gateway_on_a_terminal(flying) as (terminal, process):
        read_until(terminal, "space or k")
        flying.fleet.wait_ready(timeout_s=30)
        flying.fleet.take_off(["h1"], height_m=0.3, timeout_s=40)
        os.write(terminal, b"x")
        os.write(terminal, b" ")
        flying.fleet.wait_until(lambda: all_states(flying, "killed"), 30, "not killed", NAMES)
        os.write(terminal, b"\x03")
        assert process.wait(20) == 0


@pytest.mark.lockstep
def test_sigterm_brings_everybody_down_and_ends_on_throttle_low(flying: Flying, truth: Truth) -> None:
    log, restarts = RadioLog(flying), flying.restarts("transmitters")
    terminated_s = flying.now_s()
    os.kill(flying.pid("transmitters"), signal.SIGTERM)
    flying.fleet.wait_until(
        lambda: (
            all(landed_gently(truth, name) for name in NAMES)
            and all_states(flying, "disarmed")
            and flying.restarts("transmitters") == restarts + 1
        ),
        30,
        "not landed",
        NAMES,
    )
    for name in NAMES:
        last = log.throttles(name, terminated_s, flying.started_s("transmitters"))[-25:]
        assert [round(throttle) for throttle in last] == [THROTTLE_LOW_US] * 25


@pytest.mark.campaign
def test_exception_in_the_gateway_brings_everybody_down_and_ends_on_throttle_low(
    flying: Flying, truth: Truth, tmp_path: Path
) -> None:
    log, program = RadioLog(flying), Path(__file__).with_name("failing_gateway.py")
    flying.fleet.land()
    stop_supervised_gateway(flying)
    with (
        (tmp_path / "gateway.log").open("w+") as said,
        subprocess.Popen([sys.executable, program, flying.path], stderr=said) as gateway,
    ):
        try:
            flying.fleet.take_off(height_m=0.5, timeout_s=40)
            gateway.send_signal(signal.SIGUSR2)
            assert gateway.wait(20) == 1
        finally:
            gateway.kill()
        said.seek(0)
        assert FAULT in said.read()
    flying.fleet.wait_until(lambda: all(landed_gently(truth, name) for name in NAMES), 30, "not landed")
    for name in NAMES:
        flying.fleet.wait_until(
            lambda name=name: (  # type: ignore[misc]
                [round(throttle) for _, throttle in log.frames(name)[-25:]] == [THROTTLE_LOW_US] * 25
            ),
            30,
            f"{name} does not end on throttle low",
        )


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.campaign)])
def test_gateway_brings_vehicles_down_by_itself_when_the_bus_is_lost(
    flying: Flying, truth: Truth, how: signal.Signals
) -> None:
    router = flying.launcher_of("router").supervisor.children["router"]
    pid, restarts = flying.pid("router"), router.restarts
    gateway, simulator = flying.pid("transmitters"), flying.pid("simulator")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rcopterx.deploy.processes.supervisor, "restart_pause_s", lambda _: 4.0)
        if how is signal.SIGSTOP:
            with flying.unwatched():
                os.kill(pid, how)
                flying.fleet.wait_until(lambda: not received_lately(flying, 4.0), 30, "the bus is not lost")
                os.kill(pid, signal.SIGCONT)
        else:
            os.kill(pid, how)
            flying.fleet.wait_until(lambda: router.restarts == restarts + 1, 30, "no new router")
    flying.fleet.wait_until(
        lambda: all(landed_gently(truth, name) for name in NAMES), 30, "not landed gently"
    )
    flying.fleet.wait_until(lambda: all_states(flying, "cut", "disarmed"), 30, "gateway not back on the bus")
    assert (flying.pid("transmitters"), flying.pid("simulator")) == (gateway, simulator)
    flying.fleet.wait_until(
        lambda: all(flying.fleet.state_of(name).phase == "ground" for name in NAMES), 30, "agents unaware"
    )


def received_lately(flying: Flying, limit_s: float) -> bool:
    ages = [flying.fleet.state_of(name).agent_age_s for name in NAMES]
    return any(age is not None and age < limit_s for age in ages)
