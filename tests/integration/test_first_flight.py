"""A whole fleet of real processes takes off, keeps its formation, and survives what can happen to it."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, fleet_text, free_port, land_gently, transmitter_state

from bus import channels
from ground_station.fleet import Fleet
from ground_station.recorder import Recorder
from ground_station.report import FlightFigures
from ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


def fly_to(flying: Flying, position_m: tuple[float, float, float], tolerance_m: float = 0.1) -> None:
    """Send the leader somewhere and wait until the truth says that it is there."""
    truth = Truth(flying)
    flying.fleet["h1"].go_to(position_m)

    def there() -> bool:
        vehicle = truth("h1")
        return (
            vehicle is not None and np.linalg.norm(np.subtract(vehicle.position_m, position_m)) < tolerance_m
        )

    flying.fleet.wait_until(there, 10, f"h1 is not at {position_m}")


def wait_for_ticks(flying: Flying, count: int) -> None:
    """Wait until every vehicle has commanded so many times more."""
    inboxes = {name: flying.fleet.session.subscribe(channels.COMMAND, name) for name in NAMES}
    first: dict[str, int] = {}

    def passed() -> bool:
        for name, inbox in inboxes.items():
            received = inbox.latest()
            if received is None:
                return False
            sequence = received.message.sequence
            if sequence - first.setdefault(name, sequence) < count:
                return False
        return True

    flying.fleet.wait_until(passed, 20, f"fewer than {count} commands")


def in_formation(truth: Truth, flying: Flying, tolerance_m: float) -> bool:
    leader = truth("h1")
    for name in ("h2", "h3"):
        follower = truth(name)
        link = flying.fleet.file.vehicles[name].follow[0]
        if leader is None or follower is None:
            return False
        gap = np.subtract(follower.position_m, leader.position_m) - np.array(link.offset_m)
        if np.linalg.norm(gap) > tolerance_m:
            return False
    return True


def test_trio_takes_off_flies_in_formation_and_lands(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    recorder = Recorder(flying.fleet.session)
    recorder.start()
    fly_to(flying, (0.3, 0.1, 1.0))
    flying.fleet.wait_until(lambda: in_formation(truth, flying, 0.1), 10, "no formation")
    wait_for_ticks(flying, 100)
    truth.assert_nobody_touched_down()
    figures = FlightFigures(recorder.stop(), NAMES)
    for name in NAMES:
        table = figures.vehicle(name)
        assert table["ticks"] >= 100
        assert table["tracking_error_mm"]["rms"] < 500
    assert len(figures.pose_to_command_ms()) > 50
    assert len(figures.frame_to_radio_ms()) > 50
    land_gently(flying, truth)


def test_trio_flies_spread_over_two_hosts_with_a_router_each(launch: Launch) -> None:
    hosts = {"main": ("127.0.0.1", free_port()), "second": ("127.0.0.2", free_port("127.0.0.2"))}
    flying = launch(fleet_text(free_port(), hosts, agent_host="second"))
    assert "router" in flying.launchers["main"].supervisor.running()
    assert "router" in flying.launchers["second"].supervisor.running()
    assert "agent-h1" in flying.launchers["second"].supervisor.running()
    assert "transmitters" in flying.launchers["main"].supervisor.running()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    fly_to(flying, (0.2, 0.0, 0.9))
    flying.fleet.wait_until(lambda: in_formation(truth, flying, 0.1), 10, "no formation")
    truth.assert_nobody_touched_down()


@pytest.mark.parametrize("victim", ["h1", "h2"])
def test_vehicle_flies_on_when_its_agent_is_killed(launch: Launch, victim: str) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    flying.kill(f"agent-{victim}")
    flying.fleet.wait_until(
        lambda: (
            flying.restarts(f"agent-{victim}") == 1
            and flying.fleet.state_of(victim).phase == "flying"
            and (flying.fleet.state_of(victim).agent_age_s or 1.0) < 0.5
            and transmitter_state(flying, victim) == "armed"
        ),
        10,
        "the agent did not come back",
    )
    flying.fleet.wait_until(lambda: in_formation(truth, flying, 0.1), 15, "no formation after the restart")
    truth.assert_nobody_touched_down()
    assert flying.restarts(f"agent-{victim}") == 1
    fly_to(flying, (0.2, 0.0, 0.9))


def test_frozen_agent_is_bridged_by_its_plan_and_then_held(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    pid = flying.pid("agent-h2")
    os.kill(pid, signal.SIGSTOP)
    try:
        flying.fleet.wait_until(lambda: _counter(flying, "h2", "entered HOLD") > 0, 3, "not held", ["h2"])
    finally:
        os.kill(pid, signal.SIGCONT)
    flying.fleet.wait_until(lambda: transmitter_state(flying, "h2") == "armed", 3, "not resumed", ["h2"])
    assert _counter(flying, "h2", "planned inputs played") == 6
    flying.fleet.wait_until(lambda: in_formation(truth, flying, 0.1), 15, "no formation")
    truth.assert_nobody_touched_down()


def _counter(flying: Flying, name: str, counter: str) -> int:
    status = flying.fleet.state_of(name).transmitter
    return 0 if status is None else status.counters.get(counter, 0)


def test_restarted_follower_still_follows(launch: Launch) -> None:
    flying = launch()
    flying.fleet.take_off(height_m=0.8)
    flying.fleet["h2"].follow("h1", (-0.5, 0.4, 0.1))
    flying.fleet.wait_until(
        lambda: _offset(flying, "h2") == pytest.approx((-0.5, 0.4, 0.1), abs=1e-6), 10, "offset not reached"
    )
    flying.wait_for_spare("agent-h2")
    killed = flying.kill("agent-h2")
    flying.fleet.wait_until(
        lambda: _flies_again(flying, "h2", killed), 10, "the agent did not come back", ["h2"]
    )
    flying.fleet.wait_until(
        lambda: _offset(flying, "h2") == pytest.approx((-0.5, 0.4, 0.1), abs=1e-6), 10, "task forgotten"
    )


def _flies_again(flying: Flying, name: str, killed_pid: int) -> bool:
    status = flying.fleet.state_of(name).agent
    return status is not None and status.diagnostics.process != killed_pid and status.phase == "flying"


def _offset(flying: Flying, name: str) -> tuple[float, float, float] | None:
    status = flying.fleet.state_of(name).agent
    return status.following[0].offset_m if status is not None and status.following else None


def test_killed_laboratory_is_found_again_and_the_fleet_takes_off_anew(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.6)
    flying.kill("simulator")
    flying.fleet.wait_until(
        lambda: all(transmitter_state(flying, name) in ("disarmed", "cut") for name in NAMES),
        10,
        "transmitters do not notice the lost link",
    )
    flying.fleet.wait_until(
        lambda: _tracker_up(flying), 10, "the Vicon gateway did not find the Tracker again"
    )
    flying.fleet.wait_until(
        lambda: all(flying.fleet.state_of(name).phase == "ground" for name in NAMES), 10, "agents unaware"
    )
    flying.fleet.take_off(height_m=0.6)
    flying.fleet.wait_until(lambda: all(truth.height_m(name) > 0.3 for name in NAMES), 10, "not flying")


def _tracker_up(flying: Flying) -> bool:
    received = flying.fleet.tracker.latest()
    return (
        received is not None and received.message.state == "up" and received.message.counters["connects"] > 1
    )


def test_kill_latches_until_it_is_reset(launch: Launch) -> None:
    flying = launch()
    flying.fleet.take_off(["h2"], height_m=0.4)
    flying.fleet.kill(["h2"])
    flying.fleet.wait_until(lambda: transmitter_state(flying, "h2") == "killed", 3, "not killed")
    with pytest.raises(RefusedError):
        flying.fleet["h2"].arm()
    assert transmitter_state(flying, "h1") != "killed"
    flying.fleet.wait_until(lambda: flying.fleet.state_of("h2").phase == "ground", 5, "agent unaware")
    flying.fleet["h2"].reset()
    flying.fleet.wait_until(lambda: transmitter_state(flying, "h2") == "disarmed", 3, "not reset")


def test_cycles_and_unknown_leaders_are_refused_with_the_reason(launch: Launch) -> None:
    flying = launch()
    with pytest.raises(RefusedError, match=r"h2.*h1"):
        flying.fleet["h1"].follow("h2")
    with pytest.raises(RefusedError, match="itself"):
        flying.fleet["h1"].follow("h1")
    with pytest.raises(RefusedError, match="known are"):
        flying.fleet["h1"].follow("h9")


def test_second_fleet_on_the_same_addresses_is_refused_and_the_first_is_undisturbed(
    launch: Launch, capsys: pytest.CaptureFixture[str]
) -> None:
    from deploy.fleet_file.reading import load_fleet
    from deploy.fleet_file.schema import FleetError
    from deploy.launcher import Launcher

    flying = launch()
    with pytest.raises(FleetError, match=r"router_port.*in use"):
        Launcher(load_fleet(Path(flying.path)), "main")
    assert Fleet(flying.fleet.file).session.connected()
