"""Promises of the waiting helpers: they end when it is so, and name who is missing when it is not in time."""

import threading
import time
from collections.abc import Callable

import msgspec
import pytest
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.session import Session
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.ground_station.scripting.waiting import NotReachedError

Vehicles = dict[str, ScriptedVehicle]
LINK = LeaderLink(leader="h1", offset_m=(-0.4, 0.5, 0.0))


def flying_formation(vehicles: Vehicles) -> None:
    vehicles["h2"].following = vehicles["h2"].assigned = (LINK,)
    for vehicle in vehicles.values():
        vehicle.phase = "flying"
        vehicle.plan_at(vehicle.set_point.position_m)


def test_a_phase_is_waited_for_and_who_is_not_in_it_is_named(fleet: Fleet, vehicles: Vehicles) -> None:
    fleet.wait_for_phase("ground")
    vehicles["h1"].phase = "flying"
    fleet["h1"].wait_for_phase("flying")
    with pytest.raises(NotReachedError, match=r"after 0\.05 s: not flying: h2: ground, transmitter disarmed"):
        fleet.wait_for_phase("flying", timeout_s=0.05)
    with pytest.raises(ValueError, match="'hover'"):
        fleet.wait_for_phase("hover")


def test_a_formation_is_there_when_all_followers_are_at_their_places(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    flying_formation(vehicles)
    fleet.wait_for_formation()
    fleet["h2"].wait_for_formation()
    vehicles["h2"].plan_at((0.0, 0.0, 1.0), error_m=0.25)
    with pytest.raises(NotReachedError, match="no formation: h2: 250 mm from its place"):
        fleet.wait_for_formation(timeout_s=0.3)
    fleet.wait_for_formation(tolerance_m=0.3)


def test_a_formation_waits_for_offsets_that_are_on_their_way(fleet: Fleet, vehicles: Vehicles) -> None:
    flying_formation(vehicles)
    vehicles["h2"].assigned = (LeaderLink(leader="h1", offset_m=(-0.8, 0.5, 0.0)),)
    with pytest.raises(NotReachedError, match="h2: still on its way to its new offset"):
        fleet.wait_for_formation(timeout_s=0.3)
    vehicles["h2"].assigned = (LeaderLink(leader="h3"),)
    with pytest.raises(NotReachedError, match="h2: does not follow h3 now"):
        fleet.wait_for_formation(timeout_s=0.3)


def test_a_vehicle_that_follows_nobody_is_never_in_formation(fleet: Fleet, vehicles: Vehicles) -> None:
    flying_formation(vehicles)
    with pytest.raises(NotReachedError, match="h1: does not follow any vehicle"):
        fleet["h1"].wait_for_formation(timeout_s=0.3)
    vehicles["h2"].plan = None
    fleet["h1"].go_to((0.0, 0.0, 1.0))


def test_a_follower_on_the_floor_is_told_by_its_phase(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].assigned = (LINK,)
    with pytest.raises(NotReachedError, match="h2: ground, does not follow now"):
        fleet.wait_for_formation(timeout_s=0.3)


def test_words_from_before_the_question_do_not_count(fleet: Fleet, vehicles: Vehicles) -> None:
    flying_formation(vehicles)
    fleet.wait_for_formation()
    vehicles["h2"].speaks = False
    with pytest.raises(NotReachedError, match="h2: agent not responding"):
        fleet.wait_for_formation(timeout_s=0.3)


@pytest.mark.parametrize("wait", [Fleet.wait_for_formation, Fleet.wait_for_arrival])
def test_places_of_vehicles_that_a_take_off_left_behind_are_not_waited_for(
    fleet: Fleet, vehicles: Vehicles, wait: Callable[..., None]
) -> None:
    vehicles["h2"].state = "killed"
    if wait is Fleet.wait_for_formation:
        vehicles["h2"].assigned = (LINK,)
    wait_for(lambda: bool(fleet.problems(["h2"])), "not seen killed")
    assert len(fleet.take_off()) == 1
    vehicles["h1"].plan_at((0.0, 0.0, 0.0))
    wait(fleet, timeout_s=10.0)
    with pytest.raises(NotReachedError, match="h2: ground"):
        wait(fleet, ["h2"], timeout_s=0.3)
    vehicles["h2"].phase = "landing"
    with pytest.raises(NotReachedError, match="h2: landing"):
        wait(fleet, timeout_s=0.3)


def test_an_arrival_is_waited_for_and_the_way_that_is_left_is_told(fleet: Fleet, vehicles: Vehicles) -> None:
    flying_formation(vehicles)
    fleet["h1"].go_to((0.3, 0.0, 1.0), 1.0)
    fleet["h1"].wait_for_arrival()
    fleet.wait_for_arrival()
    vehicles["h1"].plan_at((0.3, 0.4, 1.0), 1.0)
    with pytest.raises(NotReachedError, match="not there: h1: 400 mm from its set point"):
        fleet.wait_for_arrival(timeout_s=0.3)
    vehicles["h1"].plan_at((0.3, 0.0, 1.0), 0.0)
    with pytest.raises(NotReachedError, match="h1: 57 deg from its heading"):
        fleet.wait_for_arrival(timeout_s=0.3)
    vehicles["h1"].phase = "landing"
    with pytest.raises(NotReachedError, match="h1: landing"):
        fleet.wait_for_arrival(timeout_s=0.3)


def test_a_take_off_waits_until_hosts_know_how_many_vehicles_they_serve(
    fleet: Fleet, vehicles: Vehicles, join: Callable[..., Session]
) -> None:
    host, early = join(), list[str]()
    measuring = LauncherStatus(running=("h1", "h2"), absent=(), measuring=True)

    def tell(status: LauncherStatus) -> bool:
        host.publish(channels.LAUNCHER, "main", status)
        return [told.measuring for told in fleet.launchers().values()] == [status.measuring]

    wait_for(lambda: tell(measuring), "the host is not heard")

    def finish() -> None:
        # Long enough for a take-off that does not wait.
        for _ in range(50):
            host.publish(channels.LAUNCHER, "main", measuring)
            time.sleep(0.01)
        early.extend(vehicles["h1"].verbs)
        wait_for(lambda: tell(msgspec.structs.replace(measuring, measuring=False)), "the host is not heard")

    measurement = threading.Thread(target=finish)
    measurement.start()
    fleet.take_off()
    measurement.join()
    assert (early, vehicles["h1"].verbs) == ([], ["Arm", "TakeOff"])


def test_a_launcher_that_is_late_has_not_finished_measuring(
    fleet: Fleet, vehicles: Vehicles, join: Callable[..., Session]
) -> None:
    host, refused = join(), list[str]()
    measuring = LauncherStatus(running=("h1", "h2"), absent=(), measuring=True)

    def received() -> bool:
        host.publish(channels.LAUNCHER, "main", measuring)
        return bool(fleet.launchers())

    wait_for(received, "the host is not received")
    wait_for(lambda: not fleet.launchers(), "the host is not silent")

    def take_off() -> None:
        with pytest.raises(RefusedError) as caught:
            fleet.take_off()
        refused.append(str(caught.value))

    attempt = threading.Thread(target=take_off)
    attempt.start()
    found = msgspec.structs.replace(measuring, measuring=False, flies=(0, 0, 1, 1))

    def ended() -> bool:
        host.publish(channels.LAUNCHER, "main", found)
        return not attempt.is_alive()

    wait_for(ended, "the take-off waits")
    assert vehicles["h1"].verbs == []
    assert refused[0].startswith("host main: runs the agents of 2 vehicles, but can fly at most about 1")


def test_a_take_off_is_refused_where_a_host_does_not_find_out_how_many_vehicles_it_flies(
    fleet: Fleet, vehicles: Vehicles, join: Callable[..., Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.MEASURING_S", 0.05)
    host = join()
    measuring = LauncherStatus(running=("h1", "h2"), absent=(), measuring=True)

    def received() -> bool:
        host.publish(channels.LAUNCHER, "main", measuring)
        return any(status.measuring for status in fleet.launchers().values())

    wait_for(received, "the host is not received")
    with pytest.raises(RefusedError, match="host main: measures how many vehicles it can fly"):
        fleet.take_off()
    assert vehicles["h1"].verbs == []
