"""Promises of the scripting interface: calls wait for what they ask for, and say what stands in the way."""

import io
import re
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from rich.console import Console
from support.bus import own_address
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import Arm, Follow, GoTo, Land, TakeOff
from rcopterx.bus.session import (
    BusAddress,
    BusUnreachableError,
    Incoming,
    RequestFailedError,
    Session,
)
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError, lines_of
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx.ground_station.terminal.live_table import COLUMNS, fleet_view
from rcopterx.ground_station.terminal.status import fleet_status

Vehicles = dict[str, ScriptedVehicle]


def phases(vehicles: Vehicles) -> list[str]:
    return [vehicle.phase for vehicle in vehicles.values()]


def put(vehicles: Vehicles, fleet: Fleet, phase: str, names: Iterable[str] = ("h1", "h2")) -> None:
    """Change the phase of vehicles and wait until the fleet knows."""
    for name in names:
        vehicles[name].phase = phase
        vehicles[name].state = "armed"
    wait_for(lambda: all(fleet.state_of(name).phase == phase for name in names), f"not {phase}")


def test_a_fleet_that_is_not_up_says_where_was_looked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    address = own_address()
    with pytest.raises(BusUnreachableError, match=address.endpoints[0]):
        Fleet(parse_fleet(fleet_file_text(address)), timeout_s=0.2)


def test_a_fleet_is_joined_by_its_file(
    bus_address: BusAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    path = tmp_path / "lab.toml"
    path.write_text(fleet_file_text(bus_address))
    with Fleet.connect(path) as fleet:
        assert [vehicle.name for vehicle in fleet] == ["h1", "h2"]
        assert fleet["h2"].name == "h2"
        with pytest.raises(KeyError, match="no vehicle 'h9', known are h1, h2"):
            fleet["h9"]


def test_roles_change_among_everybody_even_if_a_leader_is_heard_later_than_its_follower(
    bus_address: BusAddress, vehicles: Vehicles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    vehicles["h1"].phase = vehicles["h2"].phase = "flying"
    vehicles["h2"].following = vehicles["h2"].assigned = (LeaderLink(leader="h1", offset_m=(0.0, 1.0, 0.0)),)
    vehicles["h1"].speaks = False
    with patient_fleet(parse_fleet(fleet_file_text(bus_address))) as fleet:
        fleet.wait_for_status(["h2"])
        later = threading.Timer(0.2, setattr, (vehicles["h1"], "speaks", True))
        later.start()
        with pytest.raises(RefusedError, match="nothing has changed"):  # these vehicles change no leaders
            fleet.promote("h2")
        later.join()


def test_the_state_of_a_vehicle_is_what_its_processes_last_said(fleet: Fleet, vehicles: Vehicles) -> None:
    state = fleet["h1"].state
    assert (state.phase, state.airborne) == ("ground", False)
    assert state.transmitter is not None
    assert state.transmitter.state == "disarmed"
    assert state.pose_age_s is not None
    assert state.summary() == "h1: ground, transmitter disarmed: scripted"
    put(vehicles, fleet, "flying")
    assert fleet["h1"].state.airborne
    assert fleet["h1"].plan is None


def test_poses_and_plans_are_heard_only_if_that_is_asked_for(fleet: Fleet, vehicles: Vehicles) -> None:
    for vehicle in vehicles.values():
        vehicle.plan_at((0.0, 0.0, 1.0), error_m=0.25)
    wait_for(lambda: fleet["h1"].state.error_m == 0.25, "the agent's error is not told")
    state = fleet["h1"].state
    assert (state.plan, state.seen_at_m, state.quaternion_xyzw) == (None, None, None)
    plan = fleet["h1"].plan
    assert plan is not None, "the first question waits for it"
    assert fleet["h2"].plan is not None, "and so does the one after it"
    assert plan.reference == (-0.25, 0.0, 1.0, 0.0)
    wait_for(lambda: fleet["h1"].state.seen_at_m == (0.0, 0.0, 1.0), "poses are not heard")
    vehicles["h1"].plan_at((0.0, 0.0, 1.0), error_m=0.5)
    wait_for(lambda: fleet["h1"].state.error_m == 0.5, "the error is not that of the plan")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ready": False}, "h1: transmitter not ready: module speaks"),
        ({"state": "killed"}, r"h1: killed \(scripted\); reset it first"),
        ({"pose_age_s": 3.0}, "h1: no pose for 3.0 s"),
        ({"diagnostics": {"late_share": 0.5}}, "h1: 50% of its commands are late while it stands; fly fewer"),
        (
            {"speaks": False},
            "h1: agent not responding for .* s; h1: transmitter gateway not responding for",
        ),
    ],
)
def test_what_speaks_against_taking_off_is_told_in_words(
    fleet: Fleet, vehicles: Vehicles, change: dict[str, object], words: str
) -> None:
    for name, value in change.items():
        setattr(vehicles["h1"], name, value)
    wait_for(lambda: re.match(words, "; ".join(fleet.state_of("h1").problems())), "the problem is not seen")
    with pytest.raises(NotReachedError, match=f"after 0.05 s: not ready: {words}"):
        fleet.wait_ready(timeout_s=0.05)
    fleet.wait_ready(["h2"])


def test_a_vehicle_nobody_heard_of_has_no_words_and_no_ages(
    bus_address: BusAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    text = fleet_file_text(bus_address, ("h7",))
    with patient_fleet(parse_fleet(text)) as fleet:
        state = fleet.state_of("h7")
        assert (state.phase, state.agent, state.agent_age_s) == ("unknown", None, None)
        assert len(state.problems()) == 2
        assert state.summary() == "h7: unknown"
        with pytest.raises(NotReachedError, match="h7: agent not responding; h7: transm"):
            fleet.wait_ready(timeout_s=0.05)


def test_waiting_ends_as_soon_as_the_condition_holds_and_tells_the_states_otherwise(fleet: Fleet) -> None:
    asked: list[int] = []

    def third_time() -> bool:
        asked.append(1)
        return len(asked) == 3

    fleet.wait_until(third_time, 10.0, "never")
    assert len(asked) == 3
    with pytest.raises(NotReachedError, match=r"after 0\.05 s: no luck \(h2: ground, transmitter disarmed"):
        fleet.wait_until(lambda: False, 0.05, "no luck", ["h2"])


def test_take_off_arms_and_climbs_every_vehicle_and_waits(fleet: Fleet, vehicles: Vehicles) -> None:
    fleet.take_off(height_m=0.7)
    assert phases(vehicles) == ["flying", "flying"]
    for vehicle in vehicles.values():
        assert vehicle.requests == [Arm(), TakeOff(height_m=0.7)]


def test_take_off_leaves_others_and_those_in_the_air_alone(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying", ["h1"])
    fleet.take_off(["h1"])
    assert vehicles["h1"].requests == []
    assert phases(vehicles) == ["flying", "ground"]


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


def test_a_vehicle_that_does_not_take_off_is_named(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].stuck.add("take_off")
    with pytest.raises(NotReachedError, match=r"not all vehicles have taken off \(.*h2: armed"):
        fleet.take_off(timeout_s=0.2)


def test_landing_waits_for_the_floor_and_disarms(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    fleet.land()
    assert phases(vehicles) == ["ground", "ground"]
    assert vehicles["h1"].verbs == ["Land", "Disarm"]


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


def test_calls_of_a_vehicle_are_typed_requests(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicle = fleet["h1"]
    vehicle.go_to([0, 1, 2], 3)
    vehicle.follow("h2", (1, 2, 3), 0.5, "heading", 2.0)
    vehicle.follow([LeaderLink(leader="h2", weight=2.0)])
    vehicle.lead()
    vehicle.kill("smoke")
    vehicle.reset()
    go_to, follow, several, *others = vehicles["h1"].requests
    assert isinstance(go_to, GoTo)
    assert (go_to.set_point.position_m, go_to.set_point.yaw_rad) == ((0.0, 1.0, 2.0), 3.0)
    link = LeaderLink(leader="h2", offset_m=(1.0, 2.0, 3.0), yaw_offset_rad=0.5, frame="heading")
    assert follow == Follow(following=(link,), transition_s=2.0)
    assert several == Follow(following=(LeaderLink(leader="h2", weight=2.0),))
    assert [type(other).__name__ for other in others] == ["Lead", "KillVehicle", "ResetKill"]


def test_a_refusal_names_vehicle_and_reason(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].refusals["land"] = "nothing to land"
    with pytest.raises(RefusedError, match="h2: nothing to land"):
        fleet["h2"].land()
    assert vehicles["h2"].requests == [Land()]


def test_a_kill_is_repeated_until_the_arbiters_confirm_it(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].stuck.add("kill")
    with pytest.raises(NotReachedError, match="not killed: h2: ground, transmitter disarmed: scripted"):
        fleet.kill(["h2"], "test", timeout_s=0.3)
    assert len(vehicles["h2"].kills) >= 2
    assert {kill.vehicles for kill in vehicles["h2"].kills} == {("h2",)}
    vehicles["h2"].stuck.clear()
    fleet.kill(timeout_s=10.0)
    assert [vehicle.state for vehicle in vehicles.values()] == ["killed", "killed"]


def test_a_kill_is_not_taken_for_confirmed_by_what_was_said_before_it(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    fleet.kill(timeout_s=10.0)
    vehicles["h1"].speaks = False
    vehicles["h1"].stuck.add("kill")
    wait_for(lambda: (fleet["h1"].state.transmitter_age_s or 0.0) > 0.1, "it still speaks")
    vehicles["h1"].state = "armed"
    before = len(vehicles["h1"].kills)
    with pytest.raises(NotReachedError, match="not killed: h1"):
        fleet.kill(timeout_s=0.3)
    assert len(vehicles["h1"].kills) >= before + 2


def rendered(fleet: Fleet) -> str:
    console = Console(width=350, record=True, file=io.StringIO())
    console.print(fleet_view(fleet, COLUMNS))
    return console.export_text()


def test_the_table_shows_every_vehicle_its_task_and_what_went_wrong(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h1"].counts = {"early_stop": 3, "[bold]odd": 1}
    put(vehicles, fleet, "flying", ["h1"])
    wait_for(lambda: "early_stop 3" in rendered(fleet), "the fallback is not shown")
    text = rendered(fleet)
    assert all(words in text for column in COLUMNS for words in column.name.split())
    for part in ("flying", "armed", "0.10, 0.20, 0.30 m", "[bold]odd 1", "h2"):
        assert part in text
    assert "x:801" in text


def test_a_lowered_bandwidth_is_shown_and_noted(fleet: Fleet, vehicles: Vehicles) -> None:
    assert fleet.notes() == []
    vehicles["h2"].diagnostics = {"effort_factor": 27.0}
    wait_for(lambda: "effort ×" in rendered(fleet), "the factor is not shown")
    assert fleet.notes() == ["h2 oscillated: effort factor 27 until it is tuned"]
    assert fleet_status(fleet)["vehicles"]["h2"]["agent"]["effort_factor"] == 27.0


def test_the_table_shows_silent_vehicles_as_silent(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].speaks = False
    wait_for(lambda: "(silent)" in rendered(fleet), "the silence is not shown")


def test_the_table_says_what_the_vicon_gateway_tries(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with patient_fleet(parse_fleet(fleet_file_text(bus_address))) as fleet:
        assert "lab: Vicon gateway not responding yet" in rendered(fleet)
        assert "(silent)" in rendered(fleet)
        with scripted(join(), tracker="connecting"):
            wait_for(lambda: "Tracker is silent [/dev/null]" in rendered(fleet), "not shown")


def test_ctrl_c_in_a_script_lands_the_fleet(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying")
    with pytest.raises(KeyboardInterrupt), fleet:
        raise KeyboardInterrupt
    assert phases(vehicles) == ["ground", "ground"]


def test_a_vehicle_does_not_join_below_or_into_somebody(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying", ["h1"])
    vehicles["h1"].position_m = (0.1, 0.4, 0.9)
    wait_for(lambda: (at := fleet["h1"].state.agent) and at.position_m == (0.1, 0.4, 0.9), "not there")
    words = "h2: on its way up h2 and h1 would be 0.2 m apart, the minimum distance is 0.3 m"
    with pytest.raises(RefusedError, match=words):
        fleet.join("h2")
    assert vehicles["h2"].requests == []


def test_taking_off_with_a_killed_vehicle_fails_at_once(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].state = "killed"
    wait_for(lambda: fleet["h2"].state.transmitter_state == "killed", "not seen killed")
    began_s = fleet.session.clock()
    with pytest.raises(RefusedError, match=r"^killed: h2; reset first \(rcopterx reset\)$"):
        fleet.take_off(["h1", "h2"])
    assert fleet.session.clock() - began_s < 2.0
    assert vehicles["h1"].verbs == vehicles["h2"].verbs == []


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
    with pytest.raises(
        RefusedError, match=r"^take-off failed: h1: did not lift at 1.4 times .*--step throttle$"
    ):
        fleet.take_off(["h1"], timeout_s=10.0)
