"""Vehicles that break in flight land by themselves; sound ones of the family fly on."""

import numpy as np
import pytest
from support.conditions import HELICOPTERS
from support.vehicle_types import COAXIAL

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose, PlantFaults
from rcopterx_studies.experiments.events import GoToEvent, PilotEvent
from rcopterx_studies.experiments.rig import Rig, RigOptions, RigVehicle

STEPS = (
    GoToEvent(3.0, "h1", (0.6, 0.4, 1.3)),
    GoToEvent(6.0, "h1", (-0.5, -0.4, 0.8), np.pi),
    GoToEvent(9.0, "h1", (0.0, 0.0, 1.6)),
    GoToEvent(12.0, "h1", (0.6, -0.6, 0.6), -2.0),
    GoToEvent(15.0, "h1", (0.0, 0.0, 1.0)),
)
WINDY = (0.4, 0.4, 0.25, 1.0)
"""Turbulence of nearly three times that of the laboratory."""


def rig_of(seed: int, conditions: Conditions = HELICOPTERS, every: int = 1) -> Rig:
    vehicle = RigVehicle("h1", COAXIAL, BodyPose((0.0, 0.0, 1.0)), "cascade")
    return Rig([vehicle], conditions, seed, RigOptions(watch=True, slow={"h1": every}))


def broken(seed: int, faults: PlantFaults, after_s: float, longest_s: float, every: int = 1) -> Rig:
    rig = rig_of(seed, every=every)
    rig.fly(after_s)
    assert rig.pilots["h1"].vehicle_watch.fault is None
    rig.laboratory.plants["h1"].faults = faults
    for _ in range(round(longest_s / 0.2)):
        rig.fly(0.2)
        if rig.pilots["h1"].vehicle_watch.fault is not None:
            return rig
    raise AssertionError(f"it flies on with {faults}")


def lands(rig: Rig) -> None:
    rig.fly(6.0)
    plant = rig.laboratory.plants["h1"]
    assert plant.on_floor
    assert plant.touchdown_speed_m_s is not None
    assert plant.touchdown_speed_m_s < 1.0


def test_a_weak_rotor_lands_softly_and_says_why() -> None:
    rig = broken(0, PlantFaults(thrust_factor=0.65), 5.0, 2.0)
    pilot = rig.pilots["h1"]
    assert pilot.remarks[0].startswith("it lands: the thrust has fallen by 3")
    assert pilot.events["thrust_lost"] == 1
    lands(rig)


def test_a_reversed_axis_is_left_alone_from_then_on() -> None:
    rig = broken(1, PlantFaults(stick_gain=(-1.0, 1.0, 1.0, 1.0)), 5.0, 2.0)
    assert rig.pilots["h1"].remarks == ("it lands: pitch acts the wrong way round",)
    flown = rig.fly(0.5)["h1"]
    assert np.all(flown.inputs[:, 0] == 0.0)
    lands(rig)


@pytest.mark.parametrize("every", [2, 4])
def test_broken_vehicles_land_at_a_lower_control_rate_too(every: int) -> None:
    weak = broken(0, PlantFaults(thrust_factor=0.65), 5.0, 2.0, every)
    assert weak.pilots["h1"].events["thrust_lost"] == 1
    reversed_pitch = broken(1, PlantFaults(stick_gain=(-1.0, 1.0, 1.0, 1.0)), 5.0, 2.0, every)
    assert reversed_pitch.pilots["h1"].events["axis_reversed"] == 1


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("turbulence", [HELICOPTERS.turbulence_rms, WINDY])
@pytest.mark.parametrize("events", [(), STEPS], ids=["hover", "steps"])
def test_no_sound_vehicle_of_the_family_lands(
    seed: int, turbulence: tuple[float, float, float, float], events: tuple[PilotEvent, ...]
) -> None:
    from dataclasses import replace

    rig = rig_of(seed, replace(HELICOPTERS, turbulence_rms=turbulence))
    rig.fly(20.0, events)
    assert rig.pilots["h1"].vehicle_watch.fault is None


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("axis", [0, 1, 3])
@pytest.mark.parametrize(("gain", "longest_s"), [(0.0, 60.0), (-1.0, 4.0)])
def test_every_vehicle_of_the_family_lands_with_a_broken_axis(
    seed: int, axis: int, gain: float, longest_s: float
) -> None:
    gains = [1.0, 1.0, 1.0, 1.0]
    gains[axis] = gain
    rig = broken(seed, PlantFaults(stick_gain=tuple(gains)), 5.0, longest_s)  # type: ignore[arg-type]
    fault = rig.pilots["h1"].vehicle_watch.fault
    assert fault is not None
    assert fault.axes[:1] == (axis,)
    assert np.linalg.norm(rig.laboratory.plants["h1"].motion[:2]) < 1.2


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("left", [0.65, 0.6, 0.55])
def test_every_vehicle_of_the_family_lands_with_a_weak_rotor(seed: int, left: float) -> None:
    broken(seed, PlantFaults(thrust_factor=left), 5.0, 2.0)
