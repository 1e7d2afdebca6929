"""Shared processes are killed in flight, and no vehicle comes down for it."""

import pytest
from integration_support import NAMES, Flying, Truth, flown_by, fly_to, transmitter_state

from rcopterx.ground_station.scripting.fleet import Fleet

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]


def kill_and_wait(flying: Flying, process: str) -> None:
    """Kill a process; the supervisor starts another one, with which all fly."""
    restarts = flying.restarts(process)
    flying.wait_for_spare(process)
    flying.kill(process)
    flying.fleet.wait_until(lambda: flying.restarts(process) > restarts, 30, f"no new {process}")
    started_s = flying.now_s()

    def all_fly() -> bool:
        states = [flying.fleet.state_of(name) for name in NAMES]
        return all(
            flown_by(flying, state.name) is not None
            and state.agent_age_s is not None
            and flying.now_s() - state.agent_age_s > started_s
            for state in states
        )

    flying.fleet.wait_until(all_fly, 30, "not flying again", NAMES)


@pytest.mark.parametrize("victim", ["router", pytest.param("tracker", marks=pytest.mark.lockstep)])
def test_the_fleet_flies_on_when_its_router_or_vicon_gateway_is_killed(
    flying: Flying, truth: Truth, victim: str
) -> None:
    kill_and_wait(flying, victim)
    fly_to(flying, truth, (0.2, 0.0, 0.9))
    truth.assert_none_touched_down()


def test_a_broken_save_of_the_fleet_file_changes_nothing_in_flight(flying: Flying, truth: Truth) -> None:
    text = flying.path.read_text()
    flying.path.write_text("half of a fi")
    try:
        for process in ("agent-h1", "router"):
            kill_and_wait(flying, process)
        with Fleet.connect() as fleet:
            fleet["h1"].go_to((0.2, 0.0, 0.9))
            fleet.wait_for_arrival(["h1"])
            fleet.wait_for_formation()
    finally:
        flying.path.write_text(text)
    truth.assert_none_touched_down()


def test_killed_laboratory_is_found_again_and_the_fleet_takes_off_anew(flying: Flying, truth: Truth) -> None:
    fleet = flying.fleet
    connects = tracker_connects(flying)
    flying.kill("simulator")
    fleet.wait_until(
        lambda: all(transmitter_state(flying, name) in ("disarmed", "cut") for name in NAMES),
        30,
        "transmitters do not notice the lost link",
        NAMES,
    )
    fleet.wait_until(lambda: tracker_connects(flying) > connects, 30, "the Tracker is not found again")
    fleet.wait_until(
        lambda: all(fleet.state_of(name).phase == "ground" for name in NAMES), 30, "agents unaware", NAMES
    )
    fleet.take_off(height_m=0.6, timeout_s=40)
    fleet.wait_until(lambda: all(truth.height_m(name) > 0.3 for name in NAMES), 30, "not flying")


def tracker_connects(flying: Flying) -> int:
    """How often the Vicon gateway found its Tracker, -1 while it has none."""
    received = flying.fleet.tracker.latest()
    up = received is not None and received.message.state == "up"
    return received.message.counters["connects"] if received is not None and up else -1
