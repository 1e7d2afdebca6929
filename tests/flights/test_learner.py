"""The learner finds models in ordinary flight, and uses those of a formation together."""

import json
import logging
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.simulated_flight import simulated_flight
from support.vehicle_types import COAXIAL

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import AgentStatus, Applied, Diagnostics, LeaderLink, Pose, SetPoint
from rcopterx.bus.requests import Reply, Tune
from rcopterx.bus.session import BusAddress
from rcopterx.bus.subscription import Inbox
from rcopterx.control.identification.result import PARTS
from rcopterx.flights.learner import AGAIN_S, Learner, LearnerSettings
from rcopterx.vehicles.model import IDENTIFIED, Model, with_parameters
from rcopterx.vehicles.state import four, three

LEADER = (LeaderLink(leader="h1", offset_m=(0.0, 1.0, 0.0)),)
FLIGHT_S = 52.0
OTHER = replace(COAXIAL, input_gain=(2.5, 1.8, 16.5, 95.0))


class Bus:
    """A bus without processes: what vehicles sent, and the requests of the learner."""

    def __init__(self) -> None:
        self.now_s, self.requests, self.refusal = 0.0, list[tuple[str, Tune]](), ""
        self.inboxes: dict[tuple[str, str], Inbox[Any]] = {}

    def clock(self) -> float:
        return self.now_s

    def subscribe(self, channel: Any, unit: str, depth: int = 1, **_: object) -> Inbox[Any]:
        return self.inboxes.setdefault((channel.topic, unit), Inbox(channel, depth, unit))

    def request(self, unit: str, request: Tune, _timeout_s: float) -> Reply:
        self.requests.append((unit, request))
        return Reply(accepted=not self.refusal, reason=self.refusal)

    def send(self, channel: Any, unit: str, message: Any) -> None:
        self.inboxes[channel.topic, unit].store(encode(message), self.now_s)


class Fleet:
    """A learner and the vehicles that it sees."""

    def __init__(self, directory: Path, models: dict[str, Model]) -> None:
        self.bus, self.frame = Bus(), 1
        settings = LearnerSettings(BusAddress((), "lab"), models, dict.fromkeys(models, 0.02), directory)
        self.learner = Learner(settings, self.bus)  # type: ignore[arg-type]  # as far as a learner uses it
        self.names = list(models)

    def fly(self, true: Model, seconds: float = FLIGHT_S, still: bool = False) -> None:
        flight = simulated_flight(true, max(seconds, 20.0)).part(0.0, min(1.0, seconds / 20.0))
        for row in range(len(flight.yaw_rad)):
            position = flight.position_m[0] if still else flight.position_m[row]
            assert flight.tilt is not None
            x, y = flight.tilt[row]
            heading, lean = flight.yaw_rad[row] / 2, (-y / 2, x / 2)
            cosine, sine = math.cos(heading), math.sin(heading)
            turned = (lean[0] * cosine + lean[1] * sine, lean[1] * cosine - lean[0] * sine, sine, cosine)
            quaternion = np.array(turned) / math.hypot(*turned)
            pose = Pose(
                epoch=1, frame=self.frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=False,
                position_m=three(position), quaternion_xyzw=four(quaternion),
            )  # fmt: skip
            sticks = Applied(
                state="armed", input=four(flight.inputs[row]), pulse_width_us=(), epoch=1, frame=self.frame,
                sequence=self.frame, fresh=True,
            )  # fmt: skip
            for name in self.names:
                self.bus.send(channels.POSE, name, pose)
                self.bus.send(channels.APPLIED, name, sticks)
            self.frame += 1
        self.bus.now_s += seconds

    def report(self, name: str, phase: str = "flying", late_share: float = 0.0, **values: Any) -> None:
        diagnostics = Diagnostics(controller="cascade", estimator="extended_kalman", horizon=50, **values)
        status = AgentStatus(
            phase=phase, epoch=1, frame=self.frame, diagnostics=diagnostics, late_share=late_share,
            set_point=SetPoint(position_m=(0.0, 0.0, 1.0), yaw_rad=0.0),
            assigned=() if name == "h1" else LEADER,
        )  # fmt: skip
        self.bus.send(channels.AGENT_STATUS, name, status)


@pytest.fixture
def logged(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    with caplog.at_level(logging.INFO):
        yield caplog


def test_a_formation_learns_together_and_its_models_are_kept(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path, {"h1": COAXIAL, "h2": COAXIAL})
    fleet.fly(OTHER)
    for name in fleet.names:
        fleet.report(name)
    fleet.learner.step()
    assert [name for name, _ in fleet.bus.requests] == ["h1", "h2"]
    learned = fleet.bus.requests[0][1]
    assert learned.learned == PARTS
    model = with_parameters(COAXIAL, learned.model)
    assert model.input_gain[:3] == pytest.approx(OTHER.input_gain[:3], rel=0.1)
    assert replace(model.uncertainty, tilt_damping=None) == IDENTIFIED
    assert json.loads((tmp_path / "h1.json").read_text())["parts"] == list(PARTS)


@pytest.mark.parametrize(
    "values",
    [
        {"phase": "landing"},
        {"client": "script"},
        {"model": {"delay_s": 0.03}},
        {"late_share": 0.5},
    ],
    ids=["lands", "flown from outside", "identified on request", "computer without room"],
)
def test_nothing_is_learned_of_a_vehicle_that(tmp_path: Path, values: dict[str, Any]) -> None:
    fleet = Fleet(tmp_path, {"h1": COAXIAL})
    fleet.fly(OTHER)
    fleet.report("h1", **values)
    fleet.learner.step()
    assert fleet.bus.requests == []


def test_a_vehicle_that_stays_where_it_is_learns_nothing(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path, {"h1": COAXIAL})
    fleet.fly(COAXIAL, still=True)
    fleet.report("h1")
    fleet.learner.step()
    assert fleet.bus.requests == []


def test_a_formation_waits_for_its_last_vehicle(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path, {"h1": COAXIAL, "h2": COAXIAL})
    fleet.fly(OTHER, 40.0)
    fleet.report("h1")
    fleet.report("h2", phase="take_off")
    fleet.learner.step()
    fleet.fly(OTHER, 20.0)
    for name in fleet.names:
        fleet.report(name)
    fleet.learner.step()
    assert fleet.bus.requests == [], "h2 has flown for 20 s"


def test_a_vehicle_beyond_its_type_keeps_its_model(tmp_path: Path, logged: pytest.LogCaptureFixture) -> None:
    fleet = Fleet(tmp_path, {"h1": COAXIAL})
    fleet.fly(replace(COAXIAL, input_gain=(0.8, 0.8, 12.0, 45.0)))
    fleet.report("h1")
    fleet.learner.step()
    assert fleet.bus.requests == []
    assert "h1: not learned: pitch gain is 0." in logged.text
    assert not (tmp_path / "h1.json").exists()


def test_it_learns_again_later_and_never_less(tmp_path: Path) -> None:
    fleet = Fleet(tmp_path, {"h1": COAXIAL})
    fleet.fly(OTHER)
    fleet.report("h1")
    fleet.learner.step()
    fleet.fly(OTHER)
    fleet.report("h1", model={"delay_s": 0.02}, learned=PARTS)
    fleet.learner.step()
    assert len(fleet.bus.requests) == 1, "soon afterwards"
    fleet.bus.now_s += AGAIN_S
    fleet.report("h1", model={"delay_s": 0.02}, learned=(*PARTS, "something else"))
    fleet.learner.step()
    assert len(fleet.bus.requests) == 1, "a part would be lost"


def test_the_model_of_an_earlier_flight_is_used_if_the_first_seconds_agree(
    tmp_path: Path, logged: pytest.LogCaptureFixture
) -> None:
    first = Fleet(tmp_path, {"h1": COAXIAL})
    first.fly(OTHER)
    first.report("h1")
    first.learner.step()
    same = Fleet(tmp_path, {"h1": COAXIAL})
    same.fly(OTHER, 15.0)
    same.report("h1")
    same.learner.step()
    assert [request.learned for _, request in same.bus.requests] == [PARTS]
    assert "from a flight of 2" in logged.text
    repaired = Fleet(tmp_path, {"h1": COAXIAL})
    repaired.fly(replace(COAXIAL, input_gain=(1.6, 2.6, 22.0, 150.0)), 15.0)
    repaired.report("h1")
    repaired.learner.step()
    assert repaired.bus.requests == []
    assert "differ from its model of" in logged.text
    changed = Fleet(tmp_path, {"h1": replace(COAXIAL, delay_s=0.03)})
    changed.fly(OTHER, 15.0)
    changed.report("h1")
    changed.learner.step()
    assert changed.bus.requests == [], "the fleet file has another model"
