"""Promises of the scripting interface: calls wait for what they ask for, and say what stands in the way."""

import re
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from support.bus import own_address
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, put
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import Follow, GoTo, Land
from rcopterx.bus.session import (
    BusAddress,
    BusUnreachableError,
)
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.ground_station.scripting.waiting import NotReachedError

Vehicles = dict[str, ScriptedVehicle]


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


def test_a_change_of_roles_says_whom_each_vehicle_followed_before(
    fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.regroup.regroup", lambda *_: None)
    put(vehicles, fleet, "flying")
    vehicles["h2"].following = vehicles["h2"].assigned = (LeaderLink(leader="h1", offset_m=(0.0, 1.0, 0.0)),)
    wait_for(lambda: fleet["h2"].state.assigned, "h2 does not follow")
    assert fleet.promote("h2") == ["h2 leads (before: follows h1)", "h1 follows h2 (before: leads)"]


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
        ({"pose_problems": ("h1 stands at z = -0.50 m",)}, "h1 stands at z = -0.50 m"),
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
    assert [type(other).__name__ for other in others] == ["Lead", "ResetKill"]
    assert {(kill.vehicles, kill.reason) for kill in vehicles["h1"].kills} == {(("h1",), "smoke")}


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


def test_a_kill_of_one_vehicle_is_repeated_as_well(fleet: Fleet, vehicles: Vehicles) -> None:
    h1 = vehicles["h1"]
    h1.stuck.add("kill")

    def recover() -> None:
        wait_for(lambda: h1.kills, "no kill arrives")
        h1.stuck.clear()

    later = threading.Thread(target=recover)
    later.start()
    fleet["h1"].kill()
    later.join()
    assert [vehicle.state for vehicle in vehicles.values()] == ["killed", "disarmed"]
    assert len(h1.kills) >= 2


def test_a_name_that_is_no_list_is_one_vehicle(fleet: Fleet, vehicles: Vehicles) -> None:
    fleet.take_off("h1")
    fleet.wait_for_phase("flying", "h1")
    fleet.wait_for_arrival("h1", tolerance_m=1.0)
    fleet.land("h1")
    assert vehicles["h1"].verbs == ["Arm", "TakeOff", "Land", "Disarm"]
    fleet.kill("h1", timeout_s=10.0)
    assert [vehicle.state for vehicle in vehicles.values()] == ["killed", "disarmed"]
    assert fleet.problems("h1") == ["h1: killed (scripted); reset it first"]
    assert vehicles["h2"].verbs == []


@pytest.mark.parametrize(
    "call",
    [
        Fleet.arm, Fleet.take_off, Fleet.land, Fleet.kill, Fleet.problems, Fleet.wait_for_status,
        Fleet.wait_ready, Fleet.wait_for_formation, Fleet.wait_for_arrival,
    ],
)  # fmt: skip
def test_an_unknown_name_is_refused_before_anything_is_sent(
    fleet: Fleet, vehicles: Vehicles, call: Callable[..., object]
) -> None:
    with pytest.raises(KeyError, match="no vehicle 'h9', known are h1, h2"):
        call(fleet, ["h1", "h9"])
    with pytest.raises(KeyError, match="no vehicle 'h9'"):
        fleet.wait_for_phase("ground", ["h9"])
    with pytest.raises(KeyError, match="no vehicle 'h9'"):
        fleet.wait_until(lambda: True, 1.0, "nothing", ["h9"])
    assert vehicles["h1"].requests == vehicles["h1"].kills == []


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


def test_a_vehicle_does_not_join_below_or_into_somebody(fleet: Fleet, vehicles: Vehicles) -> None:
    put(vehicles, fleet, "flying", ["h1"])
    vehicles["h1"].position_m = (0.1, 0.4, 0.9)
    wait_for(lambda: (at := fleet["h1"].state.agent) and at.position_m == (0.1, 0.4, 0.9), "not there")
    words = "h2: on its way up h2 and h1 would be 0.2 m apart, the minimum distance is 0.3 m"
    with pytest.raises(RefusedError, match=words):
        fleet.join("h2")
    assert vehicles["h2"].requests == []
