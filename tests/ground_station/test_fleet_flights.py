"""Promises of the scripting interface: vehicles arm, take off and land, also after a failure."""

import threading
from collections.abc import Callable, Iterable

import pytest
from support.scripted import ScriptedVehicle, patient_fleet, put
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import Arm, TakeOff
from rcopterx.bus.session import (
    Incoming,
    RequestFailedError,
)
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError, lines_of
from rcopterx.ground_station.scripting.waiting import NotReachedError, StoppedError, stopped_by

Vehicles = dict[str, ScriptedVehicle]


def phases(vehicles: Vehicles) -> list[str]:
    return [vehicle.phase for vehicle in vehicles.values()]


def test_take_off_arms_and_climbs_every_vehicle_and_waits(fleet: Fleet, vehicles: Vehicles) -> None:
    fleet.take_off(height_m=0.7)
    assert phases(vehicles) == ["flying", "flying"]
    for vehicle in vehicles.values():
        assert vehicle.requests == [Arm(), TakeOff(height_m=0.7)]


def test_vehicles_hold_where_they_are_if_one_refuses_its_way_home(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    vehicles["h1"].position_m, vehicles["h2"].position_m = (0.5, 0.0, 1.0), (-0.5, 0.0, 1.0)
    vehicles["h2"].refusals["fly"] = "too fast"
    with pytest.raises(RefusedError, match="h2: too fast"):
        fleet.home()
    for vehicle in vehicles.values():
        assert vehicle.verbs == ["Lead", "Fly", "Lead"]
        assert vehicle.phase == "flying"


def test_a_follower_whose_status_comes_late_holds_as_the_one_vehicle_that_is_called_home_leaves(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    put(vehicles, fleet, "flying")
    h1, h2 = vehicles["h1"], vehicles["h2"]
    h2.following = h2.assigned = (LeaderLink(leader="h1", offset_m=(-1.0, 0.0, 0.0)),)
    h1.position_m, h2.position_m, h2.speaks = (0.5, 0.0, 1.0), (-0.5, 0.0, 1.0), False
    wait_for(lambda: "h2" not in fleet.statuses(), "h2 is not silent")
    late = threading.Timer(0.3, setattr, (h2, "speaks", True))
    with patient_fleet(fleet.file) as joined:
        late.start()
        joined.home(["h1"])
    assert h2.verbs == ["Lead"]
    assert (h1.phase, h2.phase) == ("ground", "flying")


def test_take_off_leaves_others_and_those_in_the_air_alone(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying", ["h1"])
    fleet.take_off(["h1"])
    assert vehicles["h1"].requests == []
    assert phases(vehicles) == ["flying", "ground"]


@pytest.mark.parametrize("firmware", [None, False])
def test_a_take_off_does_not_mistake_the_last_status_before_a_kill_for_a_flight(
    fleet: Fleet, vehicles: Vehicles, firmware: bool | None
) -> None:
    h1 = vehicles["h1"]
    put(vehicles, fleet, "flying", ["h1"])
    h1.agent_speaks, h1.armed = False, firmware
    fleet["h1"].kill()
    fleet["h1"].reset()
    wait_for(lambda: fleet["h1"].state.transmitter_state == "disarmed", "not seen reset")
    assert fleet["h1"].state.phase == "flying"

    def report() -> None:
        h1.agent_speaks, h1.armed = True, None

    later = threading.Timer(0.2, report)
    later.start()
    fleet.take_off(["h1"])
    later.join()
    assert h1.verbs == ["ResetKill", "Arm", "TakeOff"]


def test_a_take_off_does_not_mistake_the_last_status_before_a_reset_for_a_kill(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    h1 = vehicles["h1"]
    fleet["h1"].kill()
    wait_for(lambda: fleet["h1"].state.transmitter_state == "killed", "not seen killed")
    h1.speaks = False
    fleet["h1"].reset()
    assert fleet["h1"].state.transmitter_state == "killed"
    later = threading.Timer(0.2, setattr, (h1, "speaks", True))
    later.start()
    fleet.take_off(["h1"])
    later.join()
    assert h1.phase == "flying"


def test_arming_is_asked_again_while_it_is_refused_for_the_moment(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h1"].refusals["arm"] = "thrust was not low for half a second"

    stop = threading.Event()

    def relent() -> None:
        while not stop.wait(0.005):
            if len(vehicles["h1"].requests) >= 2:
                vehicles["h1"].refusals.clear()

    watcher = threading.Thread(target=relent)
    watcher.start()
    try:
        fleet.arm(["h1"])
    finally:
        stop.set()
        watcher.join()
    assert vehicles["h1"].phase == "armed"
    assert set(vehicles["h1"].verbs) == {"Arm"}


def test_arming_gives_up_with_the_reason(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].refusals["arm"] = "killed"
    with pytest.raises(RefusedError, match="h2: killed"):
        fleet.arm(["h2"], timeout_s=0.1)


@pytest.mark.parametrize("disarming", ["obeyed", "refused"])
def test_a_vehicle_whose_firmware_does_not_arm_is_named_and_disarmed(
    fleet: Fleet, vehicles: Vehicles, disarming: str
) -> None:
    vehicles["h2"].armed = False
    if disarming == "refused":
        vehicles["h2"].refusals["disarm"] = "no"
    with pytest.raises(NotReachedError, match=r"h2: armed, .*; not by its firmware: module speaks"):
        fleet.arm(timeout_s=0.2)
    assert vehicles["h1"].verbs == ["Arm"]
    assert vehicles["h2"].verbs == ["Arm", "Disarm"]


def test_a_vehicle_that_does_not_take_off_is_named(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].stuck.add("take_off")
    with pytest.raises(NotReachedError, match=r"not all vehicles have taken off \(.*h2: armed"):
        fleet.take_off(timeout_s=0.2)


def test_landing_waits_for_the_floor_and_disarms(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    fleet.land()
    assert phases(vehicles) == ["ground", "ground"]
    assert vehicles["h1"].verbs == ["Land", "Disarm"]


@pytest.mark.parametrize("disarms", [False, True])
def test_a_landing_is_over_once_the_firmware_reports_that_it_is_disarmed(
    fleet: Fleet, vehicles: Vehicles, disarms: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.FIRMWARE_DISARM_S", 10.0 if disarms else 0.2)
    put(vehicles, fleet, "flying")
    vehicles["h2"].armed = True
    wait_for(lambda: fleet["h2"].state.firmware_armed is True, "not seen armed")
    later = threading.Timer(0.3, setattr, (vehicles["h2"], "armed", False))
    if disarms:
        later.start()
        fleet.land()
        assert fleet["h2"].state.firmware_armed is False
        later.join()
        return
    with pytest.raises(NotReachedError, match=r"not all vehicles have disarmed \(.*h2: ground"):
        fleet.land()
    assert vehicles["h1"].verbs == vehicles["h2"].verbs == ["Land", "Disarm"]


def test_landing_leaves_those_on_the_floor_and_killed_ones_alone(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying", ["h1"])
    vehicles["h2"].state = "killed"

    def known() -> bool:
        transmitter = fleet.state_of("h2").transmitter
        return transmitter is not None and transmitter.state == "killed"

    wait_for(known, "not known as killed")
    fleet.land()
    assert vehicles["h2"].requests == []


@pytest.mark.parametrize("fault", ["silent", "refuses"])
def test_a_vehicle_that_cannot_be_landed_does_not_keep_the_others_up(
    fleet: Fleet, vehicles: Vehicles, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(vehicles, fleet, "flying")
    if fault == "silent":
        monkeypatch.setattr("rcopterx.ground_station.scripting.vehicle.ANSWER_S", 2.0)
        vehicles["h1"].silent.add("land")
    else:
        vehicles["h1"].refusals["land"] = "no"
    with pytest.raises((RefusedError, RequestFailedError), match="h1"):
        fleet.land()
    assert phases(vehicles) == ["flying", "ground"]
    assert vehicles["h2"].verbs == ["Land", "Disarm"]


def test_who_touched_down_meanwhile_refuses_to_land_and_that_is_no_error(
    fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(vehicles, fleet, "flying")
    h1 = vehicles["h1"]
    h1.refusals["land"] = "nothing to land, the phase is ground"
    answer = h1.answer

    def touch_down(incoming: Incoming) -> None:
        h1.phase = "ground"
        answer(incoming)

    monkeypatch.setattr(h1, "answer", touch_down)
    fleet.land()
    assert phases(vehicles) == ["ground", "ground"]
    assert vehicles["h1"].verbs == ["Land", "Disarm"]


def test_an_error_in_a_script_lands_the_fleet(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    with pytest.raises(ZeroDivisionError), fleet:
        _ = 1 / 0
    assert phases(vehicles) == ["ground", "ground"]


def test_the_error_of_a_script_stays_the_error_when_the_landing_fails_as_well(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    put(vehicles, fleet, "flying")
    for name, reason in (("h1", "stuck"), ("h2", "no time")):
        vehicles[name].refusals["land"] = reason
    with pytest.raises(ZeroDivisionError) as caught, fleet:
        _ = 1 / 0
    assert lines_of(caught.value) == ("division by zero", "landing failed as well: h1: stuck", "h2: no time")


def test_of_several_vehicles_that_cannot_be_landed_all_are_told_and_the_others_disarmed(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    put(vehicles, fleet, "flying")
    vehicles["h1"].stuck.add("land")
    with pytest.raises(NotReachedError, match="not all vehicles have landed"):
        fleet.land(timeout_s=0.3)
    assert vehicles["h2"].verbs == ["Land", "Disarm"]
    vehicles["h1"].stuck.clear()
    vehicles["h1"].refusals["land"] = "busy"
    vehicles["h2"].refusals["land"] = "busy, too"
    put(vehicles, fleet, "flying")
    with pytest.raises(RefusedError) as caught:
        fleet.land()
    assert lines_of(caught.value) == ("h1: busy", "h2: busy, too")


def test_a_script_that_ends_well_leaves_the_fleet_in_the_air(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    with fleet:
        pass
    assert phases(vehicles) == ["flying", "flying"]


def test_ctrl_c_in_a_script_lands_the_fleet(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    with pytest.raises(KeyboardInterrupt), fleet:
        raise KeyboardInterrupt
    assert phases(vehicles) == ["ground", "ground"]


def test_taking_off_with_a_killed_vehicle_fails_at_once(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].state = "killed"
    wait_for(lambda: fleet["h2"].state.transmitter_state == "killed", "not seen killed")
    began_s = fleet.session.clock()
    with pytest.raises(RefusedError, match=r"^killed: h2; reset first \(rcopterx reset\)$"):
        fleet.take_off(["h1", "h2"])
    assert fleet.session.clock() - began_s < 2.0
    assert vehicles["h1"].verbs == vehicles["h2"].verbs == []


def test_a_take_off_that_ends_on_the_floor_fails_at_once_with_the_reason(
    fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicles["h1"].stuck.add("take_off")
    vehicles["h1"].phase, vehicles["h1"].state = "takeoff", "armed"
    wait_for(lambda: fleet["h1"].state.phase == "takeoff", "not seen to take off")

    wait_until = fleet.wait_until

    def dropped(condition: Callable[[], bool], timeout_s: float, what: str, names: Iterable[str]) -> None:
        """It falls once it has been seen to climb."""
        if what == "not all vehicles have taken off":
            assert not condition()
            vehicles["h1"].phase = "armed"
        wait_until(condition, timeout_s, what, names)

    monkeypatch.setattr(fleet, "wait_until", dropped)
    with pytest.raises(RefusedError, match=r"^take-off failed: h1: did not lift: charge .*--step throttle$"):
        fleet.take_off(["h1"], timeout_s=10.0)


def test_a_killed_vehicle_stays_behind_at_once_when_everybody_takes_off(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h2"].state = "killed"
    wait_for(lambda: fleet["h2"].state.transmitter_state == "killed", "not seen killed")
    assert fleet.take_off() == ["h2: killed (scripted); reset it first"]
    assert vehicles["h1"].phase == "flying"
    vehicles["h1"].state = "killed"
    wait_for(lambda: fleet["h1"].state.transmitter_state == "killed", "not seen killed")
    with pytest.raises(RefusedError, match="killed: h1, h2; reset first"):
        fleet.take_off()


def test_a_killed_vehicle_stays_behind_although_the_others_take_long_to_start(
    fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.STAY_BEHIND_S", 0.05)
    vehicles["h1"].ready, vehicles["h2"].state = False, "killed"
    wait_for(lambda: len(fleet.problems()) == 2, "not seen killed and not ready")
    wait_ready = fleet.wait_ready

    def ready_later(names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        vehicles["h1"].ready = timeout_s > 1.0
        wait_ready(names, timeout_s)

    monkeypatch.setattr(fleet, "wait_ready", ready_later)
    assert fleet.take_off() == ["h2: killed (scripted); reset it first"]
    assert phases(vehicles) == ["flying", "ground"]


def test_ctrl_c_during_a_take_off_that_waits_starts_no_vehicle(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h1"].ready, ctrl_c = False, threading.Event()
    wait_for(lambda: bool(fleet.problems()), "not seen as not ready")
    ctrl_c.set()
    with stopped_by(ctrl_c), pytest.raises(StoppedError):
        fleet.take_off()
    assert vehicles["h2"].verbs == []
