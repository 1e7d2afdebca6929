"""The closed loop in one process: reproducible, ordered by leaders, and flown by the pilots of flight."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from support.conditions import HELICOPTER, HELICOPTERS, IDEAL, LABORATORY
from support.vehicle_types import COAXIAL_LAG, QUADROTOR

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.topology import places
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import Array
from rcopterx_studies.experiments.events import FollowEvent, GoToEvent, LeadEvent, PilotEvent
from rcopterx_studies.experiments.network import PERFECT, LinkQuality
from rcopterx_studies.experiments.record import FlightRecord, rms
from rcopterx_studies.experiments.rig import (
    Rig,
    RigError,
    RigOptions,
    RigVehicle,
    flying_order,
)
from rcopterx_studies.experiments.schemes import CASCADE, NO_HURRY

OFFSET_M = (-0.4, 0.5, 0.0)
STEP = GoToEvent(2.0, "h1", (0.5, 0.0, 1.2), np.pi / 2)


def leader(controller: str = "cascade", **settings: object) -> RigVehicle:
    return RigVehicle(
        "h1", COAXIAL_LAG, BodyPose((0.0, 0.0, 1.0)), controller, settings, horizon=30,
        as_published=controller == "paper",
    )  # fmt: skip


def follower(controller: str = "cascade", **settings: object) -> RigVehicle:
    return RigVehicle(
        "h2", COAXIAL_LAG, BodyPose((-0.4, 0.5, 1.0)), controller, settings, horizon=30,
        following=(LeaderLink(leader="h1", offset_m=OFFSET_M),),
    )  # fmt: skip


def pair(controller: str = "cascade") -> list[RigVehicle]:
    settings = NO_HURRY if controller == "paper" else {}
    return [leader(controller, **settings), follower(controller, **settings)]


def flown(
    vehicles: Sequence[RigVehicle],
    events: Sequence[PilotEvent] = (STEP,),
    seconds: float = 6.0,
    conditions: Conditions = IDEAL,
    seed: int = 0,
    links: LinkQuality = PERFECT,
) -> FlightRecord:
    options = RigOptions(links)
    return Rig(vehicles, conditions, seed, options).fly(seconds, events)


@pytest.mark.parametrize("controller", ["paper", "cascade"])
def test_same_seed_gives_exactly_the_same_flight(controller: str) -> None:
    first, again, other = (
        flown(pair(controller), seconds=2.6, conditions=LABORATORY, seed=seed) for seed in (3, 3, 4)
    )
    for name in ("h1", "h2"):
        assert np.array_equal(first[name].motion, again[name].motion)
        assert np.array_equal(first[name].inputs, again[name].inputs)
        assert not np.allclose(first[name].motion, other[name].motion)


def test_order_of_the_vehicles_does_not_matter() -> None:
    forward, backward = flown(pair(), seconds=3.0), flown(pair()[::-1], seconds=3.0)
    assert np.array_equal(forward["h2"].motion, backward["h2"].motion)


def test_vehicles_start_hovering_in_the_air() -> None:
    record = flown(pair(), events=(), seconds=2.0)
    for name, start in (("h1", (0.0, 0.0, 1.0)), ("h2", (-0.4, 0.5, 1.0))):
        assert np.abs(record[name].motion[:, :3] - start).max() < 1e-3
    assert not record.fallbacks()


def test_cascade_keeps_the_formation_where_the_papers_scheme_loses_it() -> None:
    """Followers copy the plan of their leader, as in the paper."""
    errors = {
        name: flown([replace(each, deviation_share=1.0) for each in pair(name)]).formation_error_m()
        for name in ("paper", "cascade")
    }
    assert errors["cascade"].max() < 0.005
    assert errors["paper"].max() > 0.03
    assert rms(errors["cascade"]) < rms(errors["paper"]) / 8


def test_plan_of_the_previous_frame_costs_the_leaders_acceleration_over_one_period() -> None:
    same, previous = (
        flown(pair(), links=LinkQuality(delay_s=delay_s)).formation_error_m() for delay_s in (0.0, 0.02)
    )
    assert same.max() < previous.max() < 0.015


def test_cascade_keeps_the_formation_in_the_laboratory() -> None:
    record = flown(pair(), conditions=LABORATORY, seed=1)
    assert rms(record.formation_error_m(2.0)) < 0.015
    assert record.formation_error_m(2.0).max() < 0.045
    assert not record.fallbacks()
    for name in ("h1", "h2"):
        assert not record[name].left_volume
        assert not record[name].touchdowns


def test_rig_flies_on_from_where_it_stopped() -> None:
    parts = Rig(pair(), LABORATORY, 5)
    first, second = parts.fly(2.0, (STEP,)), parts.fly(2.0, (STEP,))
    whole = Rig(pair(), LABORATORY, 5).fly(4.0, (STEP,))
    joined = np.vstack((first["h2"].motion, second["h2"].motion))
    assert np.array_equal(joined, whole["h2"].motion)


def test_follower_that_leads_holds_its_place() -> None:
    record = flown(pair(), (LeadEvent(1.0, "h2"), STEP), seconds=5.0)["h2"]
    assert np.abs(record.motion[:, :3] - (-0.4, 0.5, 1.0)).max() < 0.005
    assert np.isnan(record.station[record.time_s > 1.0]).all()


def test_leader_may_change_in_flight() -> None:
    swap = [
        LeadEvent(1.0, "h2"),
        FollowEvent(1.1, "h1", (LeaderLink(leader="h2", offset_m=(0.4, -0.5, 0.0)),)),
    ]
    record = flown(pair(), [*swap, GoToEvent(2.0, "h2", (0.0, 0.3, 1.3))], seconds=5.0)
    assert record["h1"].motion[-1, :3] == pytest.approx((0.4, -0.2, 1.3), abs=0.02)
    assert record["h1"].formation_error_m(4.5).max() < 0.005


def test_vehicles_of_both_types_fly_one_formation() -> None:
    quadrotor = replace(follower(), model=QUADROTOR)
    record = flown([leader(), quadrotor])
    assert record["h2"].motion[-1, :3] == pytest.approx((0.1, 0.5, 1.2), abs=0.05)


def in_the_room(motion: Array) -> Array:
    """Horizontal velocities of body states in the inertial frame, shape (K, 2)."""
    c, s = np.cos(motion[:, 3]), np.sin(motion[:, 3])
    xd, yd = motion[:, 4], motion[:, 5]
    return np.column_stack((c * xd - s * yd, s * xd + c * yd))


@pytest.mark.parametrize("heading", [pytest.param(0.0, marks=pytest.mark.campaign), 2.0])
@pytest.mark.parametrize("frame", ["inertial", "heading"])
def test_a_formation_of_four_headings_flies_as_one(frame: str, heading: float) -> None:
    """Whatever headings leader and followers have, they fly in the same direction of the room."""
    turns = {"h2": np.pi / 2, "h3": np.pi, "h4": -np.pi / 2}
    offsets = {"h2": (-0.4, 0.5, 0.0), "h3": (-0.5, 0.0, 0.0), "h4": (-0.4, -0.5, 0.0)}
    links = {"h1": ()} | {
        name: (LeaderLink(leader="h1", offset_m=offsets[name], yaw_offset_rad=turn, frame=frame),)
        for name, turn in turns.items()
    }
    where = places(links, {"h1": np.array([0.0, 0.0, 1.0, heading])})
    vehicles = [
        replace(leader(), name=name, start=BodyPose((x, y, z), yaw), following=links[name])
        for name, (x, y, z, yaw) in where.items()
    ]
    turn = GoToEvent(4.0, "h1", (0.5, 0.0, 1.0), heading + np.pi / 2)
    events = (GoToEvent(1.0, "h1", (0.5, 0.0, 1.0), heading), *((turn,) if frame == "inertial" else ()))
    record = flown(vehicles, events, seconds=7.0)
    ahead = (record["h1"].time_s > 1.3) & (record["h1"].time_s < 1.9)
    for name, own in turns.items():
        vehicle = record[name]
        assert vehicle.formation_error_m().max() < 0.005, name
        velocity = in_the_room(vehicle.motion[ahead])
        assert velocity[:, 0].min() > 0.2, name
        assert velocity == pytest.approx(in_the_room(record["h1"].motion[ahead]), abs=0.02), name
        assert vehicle.motion[-1, 3] - record["h1"].motion[-1, 3] == pytest.approx(own, abs=0.01), name


def test_several_leaders_and_the_leaders_heading_frame_define_one_station() -> None:
    third = replace(
        follower(),
        name="h3",
        start=BodyPose((-0.2, 0.0, 1.0)),
        following=(
            LeaderLink(leader="h1", offset_m=(-0.3, 0.0, 0.0), frame="heading"),
            LeaderLink(leader="h2", offset_m=(0.2, -0.5, 0.0), weight=3.0),
        ),
    )
    record = flown([*pair(), third], (replace(STEP, time_s=0.5),), seconds=4.0)
    h1, h2, h3 = (record[name].motion[-1] for name in ("h1", "h2", "h3"))
    turned = np.array([-0.3 * np.cos(h1[3]), -0.3 * np.sin(h1[3]), 0.0])
    wanted = 0.25 * (h1[:3] + turned) + 0.75 * (h2[:3] + np.array([0.2, -0.5, 0.0]))
    assert record["h3"].station[-1, :3] == pytest.approx(wanted)
    assert h3[:3] == pytest.approx(wanted, abs=0.02)


def test_progress_is_reported() -> None:
    fractions: list[float] = []
    Rig([leader()], IDEAL).fly(6.0, progress=fractions.append)
    assert fractions == pytest.approx([0.0, 5 / 6])


def test_unknown_leader_is_refused() -> None:
    with pytest.raises(RigError, match="unknown leader 'h1'; there are h2"):
        Rig([follower()], IDEAL)


def test_cycle_of_leaders_is_refused() -> None:
    circle = replace(leader(), following=(LeaderLink(leader="h2"),))
    with pytest.raises(RigError, match="h1 follows h2 follows h1"):
        Rig([circle, follower()], IDEAL)


@pytest.mark.parametrize(
    ("event", "reason"),
    [
        (GoToEvent(0.1, "h2", (0.0, 0.0, 1.0)), "it follows h1"),
        (GoToEvent(0.1, "h9", (0.0, 0.0, 1.0)), "no vehicle 'h9'"),
        (FollowEvent(0.0, "h2", (LeaderLink(leader="h1"),)), "no plan from h1"),
    ],
)
def test_refused_event_stops_the_experiment(event: PilotEvent, reason: str) -> None:
    with pytest.raises(RigError, match=reason):
        flown(pair(), (event,), seconds=0.2)


def test_leaders_come_before_their_followers() -> None:
    leaders = {"h4": ["h3", "h2"], "h3": ["h1"], "h2": ["h1"], "h1": []}
    order = flying_order(leaders)
    assert all(order.index(one) < order.index(name) for name, links in leaders.items() for one in links)


@pytest.mark.parametrize("conditions", [HELICOPTER, HELICOPTERS])
def test_simple_controller_hovers_helicopters_without_losing_them(conditions: Conditions) -> None:
    vehicle = RigVehicle("h1", COAXIAL_LAG, BodyPose((0.0, 0.0, 1.0)), "pid", horizon=10)
    record = Rig([vehicle], conditions, 1).fly(12.0)["h1"]
    assert record.touchdowns == 0
    settled = record.motion[record.time_s > 6.0, :3] - (0.0, 0.0, 1.0)
    assert np.linalg.norm(settled, axis=1).max() < 0.3
    assert np.ptp(record.inputs[record.time_s > 6.0, :2], axis=0).max() < 1.0, "no limit cycle at the stops"


def test_a_known_helicopter_is_within_five_centimetres_of_a_higher_place_after_1_1_s() -> None:
    """A step of 0.6 m with a climb of 0.8 m, without gusts; the climb alone takes 1.04 s."""
    calm = replace(HELICOPTER, turbulence_rms=(0.0,) * 4)
    vehicle = replace(CASCADE, knowledge="exact").vehicle("h1", BodyPose((0.0, 0.0, 1.0)), calm, 0)
    record = flown([vehicle], [GoToEvent(8.0, "h1", (0.6, 0.0, 1.8), 0.0)], 12.0, calm)["h1"]
    far = np.linalg.norm(record.motion[:, :3] - (0.6, 0.0, 1.8), axis=1) > 0.05
    assert record.time_s[far].max() < 8.0 + 1.1
