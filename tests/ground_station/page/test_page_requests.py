"""Promises of the page: it draws what a (scripted) fleet reports, and requests what is done on it."""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.bus import free_port
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink, SetPoint
from rcopterx.bus.requests import Follow, GoTo, Tune
from rcopterx.control.controllers.cascade.weights import default_weights
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.page.feed import Seen
from rcopterx.ground_station.page.guard import RequestRejectedError
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.page.steering import ALLOWED, PageSteering, decode
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.vehicles.model import IDENTIFIED, with_parameters

Vehicles = dict[str, ScriptedVehicle]


@dataclass
class Opened:
    """A page, and what browsers receive of it."""

    frame: PageFrame
    page: FleetPage
    now_s: float = 0.0

    def do(self, what: str, **arguments: object) -> None:
        """Send a request as a browser does, and wait until it is done."""
        perform = self.frame.server.perform
        assert perform is not None
        perform(json.dumps({"do": what, "arguments": arguments}))()

    def shown(self) -> dict[str, Any]:
        """Everything, after an update of every part."""
        self.now_s += 1.0
        self.page.update(self.now_s)
        message = self.frame.feed.after(Seen())
        assert message is not None
        content: dict[str, Any] = json.loads(message)
        return content

    def motion(self, name: str) -> dict[str, Any]:
        motion: dict[str, Any] = self.shown()["motion"][name]
        return motion

    @property
    def notices(self) -> list[tuple[str, bool]]:
        """Answers that every browser shows."""
        return [(one["text"], one["refused"]) for one in self.shown()["texts"].get("notices", [])]


@pytest.fixture
def opened(fleet: Fleet) -> Iterator[Opened]:
    frame = PageFrame(free_port(), fleet.file.name, "key-of-this-test")
    try:
        yield Opened(frame, FleetPage(fleet, frame))
    finally:
        frame.server.stop()


def fly(fleet: Fleet, vehicles: Vehicles) -> None:
    for vehicle in vehicles.values():
        vehicle.phase, vehicle.state = "flying", "armed"
        vehicle.plan_at((0.1, 0.2, 0.3))
    wait_for(
        lambda: all(one.state.phase == "flying" and one.state.plan is not None for one in fleet), "not flying"
    )
    wait_for(
        lambda: all(one.state.place_m == pytest.approx((0.1, 0.2, 0.3), abs=1e-3) for one in fleet),
        "not there",
    )


def follow(fleet: Fleet, vehicles: Vehicles, offset_m: tuple[float, float, float]) -> None:
    link = LeaderLink(leader="h1", offset_m=offset_m)
    vehicles["h2"].following = vehicles["h2"].assigned = (link,)
    wait_for(lambda: fleet["h2"].state.assigned, "not known")


def test_vehicles_are_where_their_agents_are_with_plans_references_and_leaders(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    assert opened.motion("h1")["place"] == [0.1, 0.2, 0.3]
    assert "handle" not in opened.motion("h1")
    assert "plan" not in opened.motion("h1")
    fly(fleet, vehicles)
    follow(fleet, vehicles, (0.0, 1.0, 0.0))
    motion = opened.motion("h1")
    assert motion["handle"] == [0.0, 0.0, 0.0]
    assert motion["reference"] == motion["plan"][-1] == [0.1, 0.2, 0.3]
    assert opened.motion("h2")["following"] == ["h1"]
    assert opened.motion("h2")["handle"] == [0.1, 1.2, 0.3]


def test_a_silent_vehicle_is_not_drawn(opened: Opened, fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h1"].speaks = False
    wait_for(lambda: fleet["h1"].state.silent, "not silent")
    assert opened.motion("h1") == {}


def test_a_leaders_handle_that_is_released_is_a_set_point(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(fleet, vehicles)
    vehicles["h1"].set_point = SetPoint(position_m=(0.5, 0.0, 1.0), yaw_rad=2.0)
    wait_for(lambda: (agent := fleet["h1"].state.agent) and agent.set_point.yaw_rad == 2.0, "not known")
    opened.do("move", name="h1", place_m=[0.1, -0.2, 1.3])
    (request,) = vehicles["h1"].requests
    assert isinstance(request, GoTo)
    assert request.set_point.position_m == pytest.approx((0.1, -0.2, 1.3))
    assert request.set_point.yaw_rad == 2.0
    assert opened.notices == [("h1: on its way to 0.10, -0.20, 1.30 m", False)]


def test_a_followers_handle_is_its_place_beside_its_leader(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(fleet, vehicles)
    follow(fleet, vehicles, (0.0, 1.0, 0.0))
    opened.do("move", name="h2", place_m=[0.6, 1.2, 0.3])
    (request,) = vehicles["h2"].requests
    assert isinstance(request, Follow)
    assert request.following[0].offset_m == pytest.approx((0.5, 1.0, 0.0), abs=1e-3)


def test_a_refusal_is_shown_with_its_reason(opened: Opened, vehicles: Vehicles) -> None:
    vehicles["h1"].refusals["go_to"] = "outside"
    opened.do("go_to", name="h1", place_m=[9.0, 0.0, 1.0], yaw_rad=0.0)
    assert opened.notices == [("h1: outside", True)]


def test_a_request_while_one_of_its_name_is_not_answered_yet_is_refused_with_the_reason(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    notices: list[tuple[str, bool]] = []
    steering = PageSteering(fleet, lambda text, refused: notices.append((text, refused)))

    def repeated() -> None:
        steering.run("landing of h1", lambda: None)
        steering.run("landing of h2", lambda: None)

    assert steering.run("landing of h1", repeated)
    assert notices == [
        ("landing of h1: still under way", True),
        ("landing of h2", False),
        ("landing of h1", False),
    ]
    assert vehicles["h1"].requests == []


def test_kill_cuts_everybody_and_only_then_there_is_something_to_reset(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    assert not opened.shown()["texts"]["killed"]
    opened.do("kill")
    assert {vehicle.state for vehicle in vehicles.values()} == {"killed"}
    wait_for(lambda: all(one.state.transmitter_state == "killed" for one in fleet), "not known")
    assert opened.shown()["texts"]["killed"]
    opened.do("reset")
    assert {vehicle.state for vehicle in vehicles.values()} == {"disarmed"}


def test_take_off_and_landing_are_requested_of_all_vehicles_or_of_one(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    opened.do("take_off")
    assert {vehicle.phase for vehicle in vehicles.values()} == {"flying"}
    opened.do("land", name="h2")
    assert [vehicle.phase for vehicle in vehicles.values()] == ["flying", "ground"]
    opened.do("land", name=None)
    assert {vehicle.phase for vehicle in vehicles.values()} == {"ground"}
    assert [refused for _, refused in opened.notices] == [False, False, False]


def test_vehicles_come_home_together_or_one_of_them(opened: Opened, fleet: Fleet, vehicles: Vehicles) -> None:
    fly(fleet, vehicles)
    vehicles["h1"].position_m, vehicles["h2"].position_m = (0.5, 0.0, 1.0), (-0.5, 0.0, 1.0)
    opened.do("home", name="h2")
    assert vehicles["h2"].verbs[-4:] == ["Lead", "Fly", "Land", "Disarm"]
    assert [vehicle.phase for vehicle in vehicles.values()] == ["flying", "ground"]
    opened.do("home", name=None)
    assert vehicles["h1"].verbs[-4:] == ["Lead", "Fly", "Land", "Disarm"]
    assert {vehicle.phase for vehicle in vehicles.values()} == {"ground"}
    assert opened.notices == [("home", False)] * 2


def test_vehicles_are_suspended_and_go_on(opened: Opened, fleet: Fleet, vehicles: Vehicles) -> None:
    opened.do("suspend")
    assert opened.notices == [("no vehicle that leads is in the air", True)]
    fly(fleet, vehicles)
    opened.do("suspend")
    opened.do("resume")
    assert vehicles["h1"].verbs[-2:] == ["Suspend", "Resume"]
    assert opened.notices[1:] == [("suspended", False), ("going on", False)]


def test_a_leader_that_is_chosen_is_followed_from_where_the_vehicle_is(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(fleet, vehicles)
    vehicles["h2"].plan_at((0.1, 1.2, 0.3))
    wait_for(lambda: fleet["h2"].state.place_m == pytest.approx((0.1, 1.2, 0.3), abs=1e-3), "not there")
    opened.do("follow", name="h2", leader="h1")
    (request,) = vehicles["h2"].requests
    assert isinstance(request, Follow)
    assert request.following[0].offset_m == pytest.approx((0.0, 1.0, 0.0), abs=1e-3)
    opened.do("follow", name="h2", leader=None)
    assert vehicles["h2"].verbs[-1] == "Lead"


def test_what_others_choose_is_shown(opened: Opened, fleet: Fleet, vehicles: Vehicles) -> None:
    fly(fleet, vehicles)
    follow(fleet, vehicles, (0.0, 1.0, 0.0))
    row = opened.shown()["texts"]["rows"]["h2"]
    assert (row["leader"], row["following"], row["controller"]) == ("h1", "h1", "paper")
    assert vehicles["h2"].requests == []


def test_a_formation_is_flown_by_all_that_fly(opened: Opened, fleet: Fleet, vehicles: Vehicles) -> None:
    opened.do("formation", shape="line", leader="h1", spacing_m=0.8, assign=False)
    assert opened.notices == [("h1 does not fly, its phase is ground", True)]
    fly(fleet, vehicles)
    opened.do("formation", shape="line", leader="h1", spacing_m=0.8, assign=False)
    (request,) = vehicles["h2"].requests
    assert isinstance(request, Follow)
    assert request.following[0].offset_m == pytest.approx((0.0, 0.8, 0.0))


def test_waypoints_are_flown_from_where_the_vehicle_is_and_none_is_a_refusal(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    opened.do("fly_through", name="h1", places_m=[])
    assert opened.notices == [("click waypoints in the scene first", True)]
    fly(fleet, vehicles)
    opened.do("fly_through", name="h1", places_m=[[0.5, 0.0, 1.0], [0.5, 0.5, 1.0]])
    assert vehicles["h1"].verbs == ["Fly"]


@pytest.mark.parametrize(
    "text",
    [
        "", "kill", "{}", '{"do": "__init__"}', '{"do": "tune", "arguments": {"name": "h1"}}',
        '{"do": "land", "arguments": {"name": "h9"}}', '{"do": "land", "arguments": {}}',
        '{"do": "move", "arguments": {"name": "h1", "place_m": [0, 0]}}',
        '{"do": "move", "arguments": {"name": "h1", "place_m": [0, 0, 1e30]}}',
        '{"do": "kill", "arguments": {"vehicles": []}}',
        '{"do": "formation", "arguments": {"shape": "star", "leader": "h1", "spacing_m": 1, "assign": true}}',
        '{"do": "weigh", "arguments": {"name": "h1", "powers": {"position": 40}}}',
    ],
)  # fmt: skip
def test_what_is_no_request_of_the_page_is_rejected(opened: Opened, text: str) -> None:
    assert opened.page.steering is not None
    with pytest.raises(RequestRejectedError):
        decode(text, opened.page.steering, ("h1", "h2"), ("h1", "h2", "wand"))


VALUES = st.recursive(
    st.none() | st.floats(allow_nan=False) | st.text(max_size=3) | st.sampled_from(["h1", "line"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
)
ARGUMENTS = st.dictionaries(st.sampled_from(["name", "leader", "place_m", "powers", "shape"]), VALUES)


@given(
    st.text()
    | st.builds(
        lambda do, values: json.dumps({"do": do, "arguments": values}), st.sampled_from(ALLOWED), ARGUMENTS
    )
)
def test_no_text_from_a_browser_raises_another_error(text: str) -> None:
    with suppress(RequestRejectedError):
        assert callable(decode(text, PageSteering.__new__(PageSteering), ("h1",), ("h1",)))


def tunings(opened: Opened, monkeypatch: pytest.MonkeyPatch) -> list[Tune]:
    """Requests to tune that the page sends from now on; all succeed."""
    requests: list[Tune] = []

    def tune(name: str, controller: str | None, settings: Any) -> bool:
        requests.append(Tune(controller=controller, controller_settings=settings))
        return True

    assert opened.page.steering is not None
    monkeypatch.setattr(opened.page.steering.weights["h1"], "_tune", tune)
    return requests


def report(fleet: Fleet, vehicle: ScriptedVehicle, **diagnostics: Any) -> None:
    """Report other diagnostics of a vehicle, and wait until the fleet has them."""
    vehicle.diagnostics |= diagnostics
    wait_for(
        lambda: (
            (agent := fleet[vehicle.name].state.agent)
            and all(getattr(agent.diagnostics, name) == value for name, value in diagnostics.items())
        ),
        "no report",
    )


def test_weights_are_factors_of_the_defaults_and_undo_brings_the_last_ones_back(
    opened: Opened, fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    report(fleet, vehicles["h1"], controller="cascade")
    requests = tunings(opened, monkeypatch)
    opened.do("weigh", name="h1", powers=None)
    assert requests == [], "there is nothing to undo"
    opened.do("weigh", name="h1", powers={"position": 1.0})
    assert opened.shown()["texts"]["powers"]["h1"]["position"] == 1.0
    opened.do("weigh", name="h1", powers=None)
    doubled, default = (np.array(one.controller_settings["state_weights"]) for one in requests)
    assert doubled / default == pytest.approx([2, 2, 2, 1, 1, 1, 1, 1])
    assert opened.shown()["texts"]["powers"]["h1"]["position"] == 0.0
    opened.do("weigh", name="h1", powers=None)
    assert len(requests) == 2, "there is nothing more to undo"


def test_weights_of_identified_vehicles_are_factors_of_those_of_the_identified_model(
    opened: Opened, fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_of(fleet.file, "h1")
    found = {"uncertainty": asdict(IDENTIFIED)}
    report(fleet, vehicles["h1"], controller="cascade", model=found)
    requests = tunings(opened, monkeypatch)
    opened.do("weigh", name="h1", powers={})
    expected = default_weights(with_parameters(model, found), fleet.file.vehicles["h1"].control.period_s)
    assert requests[0].controller_settings["input_weights"] == pytest.approx(expected.inputs)
    assert requests[0].controller_settings["state_weights"] == pytest.approx(expected.states)


@pytest.mark.parametrize("controller", ["cascade", "lqr"])
def test_undo_restores_what_the_vehicle_flew_with_before(
    opened: Opened, fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch, controller: str
) -> None:
    flown = {"input_weights": (20.0, 20.0, 30.0, 200.0), "horizon": 30}
    report(fleet, vehicles["h1"], controller=controller, controller_settings=flown)
    requests = tunings(opened, monkeypatch)
    opened.do("weigh", name="h1", powers={})
    opened.do("weigh", name="h1", powers=None)
    assert requests[0].controller == "cascade"
    assert requests[1].controller == controller
    assert requests[1].controller_settings.items() >= flown.items()


def test_samples_come_at_their_period_however_often_the_page_is_updated(opened: Opened) -> None:
    for number in range(100):
        opened.page.update(0.02 * number)
    assert len(json.loads(opened.frame.feed.after(Seen()) or b"{}")["samples"]) == 20


def test_wind_and_uncertainty_are_sent_where_they_are_known(
    opened: Opened, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(fleet, vehicles)
    report(fleet, vehicles["h1"], wind_m_s2=(0.3, 0.0), position_deviation_m=(0.0005, 0.0005, 0.001))
    assert opened.motion("h1")["wind_m_s2"] == [0.3, 0.0]
    assert opened.motion("h1")["deviation_m"] == [0.0005, 0.0005, 0.001]
    assert "wind_m_s2" not in opened.motion("h2")


def test_a_fleet_that_is_down_looks_down(opened: Opened, fleet: Fleet, vehicles: Vehicles) -> None:
    for vehicle in vehicles.values():
        vehicle.speaks = False
    wait_for(lambda: all((one.state.transmitter_age_s or 0.0) > 2.1 for one in fleet), "not silent")
    shown = opened.shown()
    assert (
        shown["texts"]["sentence"]["text"]
        == f"{fleet.file.name} is down; start it with rcopterx up {fleet.file.name}"
    )
    assert "rows" not in shown["texts"]
    assert set(map(str, shown["motion"].values())) == {"{}"}
