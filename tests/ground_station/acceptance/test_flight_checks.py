"""Promises of the checks: each is passed by the flight it describes and failed by another one."""

import math
from typing import Any

import numpy as np
import pytest
from support.statuses import flying_status

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.messages import Applied, LeaderLink, Plan, Pose
from rcopterx.bus.session import RawMessage
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.ground_station.acceptance import checks
from rcopterx.ground_station.acceptance.checks import Check
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.vehicles.tuples import Three

NAMES = ("h1", "h2")


class Flight:
    """Two vehicles, a hundred frames; h2 follows h1. Change it before it is judged."""

    def __init__(self, frames: int = 100) -> None:
        self.positions: dict[str, list[Three]] = {
            "h1": [(0.0, 0.0, 1.0)] * frames, "h2": [(-0.5, 0.0, 1.0)] * frames,
        }  # fmt: skip
        self.yaw_rad = 0.0
        self.link = LeaderLink(leader="h1", offset_m=(-0.5, 0.0, 0.0))
        self.on_floor = False
        self.touchdown_speed_m_s = 0.3
        self.states = ["armed"] * frames
        self.processes = [1] * frames
        self.phases = ["flying"] * frames
        self.late_s = 0.0
        self.truth = True

    def records(self) -> list[RawMessage]:
        found = []
        for frame in range(len(self.states)):
            if self.truth:
                found.append(self._laboratory(frame))
            for name in NAMES:
                found += self._of(name, frame)
        return found

    def _record(self, unit: str, channel: Any, message: Any) -> RawMessage:
        return RawMessage(unit, channel.topic, encode(message), 0.0)

    def _laboratory(self, frame: int) -> RawMessage:
        vehicles = {
            name: LaboratoryVehicle(
                position_m=self.positions[name][frame], yaw_rad=self.yaw_rad, velocity_m_s=(0.0, 0.0, 0.0),
                on_floor=self.on_floor, outside=False, touchdown_speed_m_s=self.touchdown_speed_m_s,
            )
            for name in NAMES
        }  # fmt: skip
        state = LaboratoryState(frame=frame, sent_s=0.02 * frame, vehicles=vehicles)
        return self._record(channels.SIMULATOR_UNIT, channels.LABORATORY, state)

    def _of(self, name: str, frame: int) -> list[RawMessage]:
        half = self.yaw_rad / 2
        quaternion = (0.0, 0.0, math.sin(half), math.cos(half))
        pose = Pose(
            epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=False,
            position_m=self.positions[name][frame], quaternion_xyzw=quaternion,
        )  # fmt: skip
        following = (self.link,) if name == "h2" else ()
        plan = Plan(
            epoch=1, frame=frame, source=name, ancestors=(), period_s=0.02, start_s=0.02,
            trajectory=TrajectoryArray.of(np.zeros((2, 12))), reference=(0.0, 0.0, 1.0, 0.0),
            following=following,
        )  # fmt: skip
        late_s = self.late_s if frame >= 50 else 0.0
        applied = Applied(
            state=self.states[frame], input=(0.0, 0.0, 0.0, 0.0), pulse_width_us=(1500.0,) * 4, epoch=1,
            frame=frame, sequence=frame, fresh=True, written_s=0.02 * frame + late_s,
        )  # fmt: skip
        status = flying_status(
            phase=self.phases[frame], controller="cascade", frame=frame, following=following, ticks=frame,
            process=self.processes[frame],
        )  # fmt: skip
        return [
            self._record(name, channels.POSE, pose),
            self._record(name, channels.PLAN, plan),
            self._record(name, channels.APPLIED, applied),
            self._record(name, channels.AGENT_STATUS, status),
        ]

    def judged(self, check: Check) -> tuple[bool, Any]:
        figures = FlightFigures(Recording(self.records()), NAMES)
        result = check.run(figures, {name: figures.vehicle(name) for name in NAMES})
        return result["passed"], result["figure"]


def test_a_formation_is_held_within_its_limits() -> None:
    flight = Flight()
    passed, figure = flight.judged(checks.formation_held(10.0, 50.0))
    assert (passed, figure) == (True, {"h2": {"rms": 0.0, "max": 0.0}})
    flight.positions["h2"][7] = (-0.5, 0.06, 1.0)
    assert not flight.judged(checks.formation_held(10.0, 50.0))[0]
    assert flight.judged(checks.formation_held(10.0, 70.0))[0]


@pytest.mark.parametrize("truth", [True, False])
def test_offsets_in_the_heading_frame_are_judged_in_it(truth: bool) -> None:
    flight = Flight()
    flight.truth = truth
    flight.yaw_rad = math.pi / 2
    flight.link = LeaderLink(leader="h1", offset_m=(-0.5, 0.0, 0.0), frame="heading")
    flight.positions["h2"] = [(0.0, -0.5, 1.0)] * 100
    assert flight.judged(checks.formation_held(1.0, 1.0))[0]
    flight.yaw_rad = 0.0
    assert not flight.judged(checks.formation_held(1.0, 1.0))[0]


def test_formation_without_followers_is_not_held() -> None:
    assert Flight(0).judged(checks.formation_held()) == (False, {})


def test_the_smallest_distance_counts() -> None:
    flight = Flight()
    assert flight.judged(checks.distance_kept) == (True, 0.5)
    flight.positions["h2"][3] = (-0.2, 0.0, 1.0)
    assert flight.judged(checks.distance_kept) == (False, 0.2)


def test_the_last_place_and_heading_count() -> None:
    flight = Flight()
    flight.positions["h1"][0] = (1.0, 0.0, 1.0)
    assert flight.judged(checks.ends_at("h1", (0.0, 0.0, 1.0))) == (True, 0.0)
    assert flight.judged(checks.ends_at("h1", (0.0, 0.2, 1.0))) == (False, 200.0)
    flight.yaw_rad = math.radians(175)
    assert flight.judged(checks.heading_ends_at("h1", -180))[0]
    assert flight.judged(checks.heading_ends_at("h1", 180 + 360)) == (True, -5.0)
    assert not flight.judged(checks.heading_ends_at("h1", 160))[0]
    assert Flight(0).judged(checks.ends_at("h1", (0.0, 0.0, 1.0))) == (False, None)
    assert Flight(0).judged(checks.heading_ends_at("h1", 0)) == (False, None)


def test_the_last_leaders_count() -> None:
    flight = Flight()
    assert flight.judged(checks.followed("h2", "h1")) == (True, ["h1"])
    assert flight.judged(checks.followed("h1"))[0]
    assert not flight.judged(checks.followed("h2"))[0]
    assert not flight.judged(checks.followed("h1", "h2"))[0]
    assert Flight(0).judged(checks.followed("h1")) == (False, None)


def test_touching_down_needs_the_floor_and_little_speed() -> None:
    flight = Flight()
    assert not flight.judged(checks.touched_down_gently)[0]
    flight.on_floor = True
    assert flight.judged(checks.touched_down_gently) == (True, [0.3, 0.3])
    flight.touchdown_speed_m_s = 1.4
    assert not flight.judged(checks.touched_down_gently)[0]


def test_the_greatest_height_counts() -> None:
    flight = Flight()
    assert flight.judged(checks.reached_height(1.0))[0]
    flight.positions["h2"][5] = (0.0, 0.0, 1.5)
    assert flight.judged(checks.reached_height(1.0)) == (False, {"h1": 1.0, "h2": 1.5})


def test_an_arbiter_that_flew_by_itself_is_a_disturbance() -> None:
    check = checks.transmitters_undisturbed
    tables: dict[str, Any] = {"h1": {"safety": []}}
    assert check.run(Flight(), tables)["passed"]  # type: ignore[arg-type]  # looks at the tables only
    tables["h1"]["safety"].append("hold: late")
    assert check.run(Flight(), tables) == {  # type: ignore[arg-type]  # same
        "name": check.name, "passed": False, "figure": {"h1": ["hold: late"]},
    }  # fmt: skip


def test_controllers_count_in_their_order() -> None:
    flight = Flight()
    assert flight.judged(checks.controllers_flown("h1", "cascade")) == (True, ["cascade"])
    assert not flight.judged(checks.controllers_flown("h1", "cascade", "lqr"))[0]


def test_agents_that_were_started_again_are_counted() -> None:
    flight = Flight()
    assert flight.judged(checks.agents_started_again("h1", 0)) == (True, 0)
    assert not flight.judged(checks.agents_started_again("h1"))[0]
    flight.processes[60:] = [2] * 40
    assert flight.judged(checks.agents_started_again("h1")) == (True, 1)
