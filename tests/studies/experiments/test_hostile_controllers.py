"""Whatever a controller of another package does, no vehicle falls, and the others fly on."""

import numpy as np
import pytest
from support.conditions import HELICOPTERS
from support.hostile import DEEDS, KINDS, SOUND_S, FloodingScheme, HostileController
from support.vehicle_types import COAXIAL

from rcopterx.agents.guards.time_limit import AlarmTimeLimit
from rcopterx.bus.messages import LeaderLink
from rcopterx.simulator.plant import BodyPose
from rcopterx_studies.experiments.rig import Rig, RigOptions, RigVehicle

PLACES_M = {"h1": (0.3, 0.0, 0.8), "h2": (-0.3, 0.45, 0.8), "h3": (-0.3, -0.45, 0.8)}
SOFT_M_S = 1.0
NEAR_M = 0.3
"""Nearer vehicles are held by their transmitter gateways."""
EACH_TIME = {
    "h1": (
        *DEEDS,
        "saturating: dives",
        "saturating: ahead",
        "saturating: all",
        "oscillating: tilt",
        "flooding",
    ),
    "h2": ("raising", "saturating: at the leader", "flooding"),
}
"""What the controllers of a leader and of a follower do each time; a campaign flies the others."""


def trio(seed: int) -> Rig:
    head = np.array(PLACES_M["h1"])
    links = {
        name: (LeaderLink(leader="h1", offset_m=tuple(np.subtract(place, head).tolist())),)
        for name, place in PLACES_M.items()
        if name != "h1"
    }
    vehicles = [
        RigVehicle(name, COAXIAL, BodyPose(place), "cascade", horizon=30, following=links.get(name, ()))
        for name, place in PLACES_M.items()
    ]
    return Rig(vehicles, HELICOPTERS, seed, RigOptions(avoid=True, guard=True, watch=True))


def fly(rig: Rig, name: str, kind: str, seconds: float) -> None:
    pilot = rig.pilots[name]
    pilot.step_guard.calls.limit = pilot.estimator.calls.limit = AlarmTimeLimit()
    hostile = FloodingScheme if kind == "flooding" else HostileController
    pilot.use_controller(hostile(COAXIAL, 0.02, hostile.Settings(kind=kind)))
    flown = rig.fly(SOUND_S + seconds)
    distances = [
        np.linalg.norm(flown[name].motion[:, :3] - flown[other].motion[:, :3], axis=1)
        for other in flown
        if other != name
    ]
    assert np.min(distances) > NEAR_M
    for other, record in flown.items():
        plant = rig.laboratory.plants[other]
        assert plant.touchdowns == 0 or (plant.touchdown_speed_m_s or 0.0) < SOFT_M_S
        assert (np.abs(record.motion[:, :2]) < 1.4).all()
        assert (record.motion[:, 2] < 2.2).all()
        if other != name and name != "h1":
            errors = np.linalg.norm(record.motion[:, :3] - PLACES_M[other], axis=1)
            assert errors.max() < 0.2


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param(name, kind, marks=() if each_time else pytest.mark.campaign)
        for name in ("h1", "h2")
        for kind in (*KINDS, "flooding")
        for each_time in [kind in EACH_TIME[name]]
    ],
)
def test_no_vehicle_falls_whatever_a_controller_does(name: str, kind: str) -> None:
    fly(trio(3), name, kind, 4.0)
