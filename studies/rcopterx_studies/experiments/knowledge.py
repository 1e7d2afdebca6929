"""Models that pilots get of their vehicles: of the type only, identified, or the true parameters.

In conditions with first-order plants there is one model, their nominal parameters. Helicopters and Crazyflies
are flown at several levels of knowledge, so that experiments can compare them.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Final, Literal

import numpy as np

from rcopterx.control.identification.excitation import DONE, UNDER_WAY, excitation_for
from rcopterx.control.identification.fit import identify
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.fleet.vehicle_types import vehicle_type
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.helicopter import helicopter_of
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.model import IDENTIFIED, Model, Uncertainty, damping_range, fitted_parameters
from rcopterx.vehicles.state import GRAVITY_M_S2, four
from rcopterx.vehicles.tilt import TiltModel
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.experiments.events import GoToEvent, PilotEvent
from rcopterx_studies.experiments.rig import Rig, RigVehicle
from rcopterx_studies.plants.identified_crazyflie import (
    FULL_THRUST_SHARE,
    FULL_TILT_RAD,
    FULL_YAW_RATE_RAD_S,
    IdentifiedCrazyflie,
    crazyflie_of,
)

COAXIAL: Final = vehicle_type("coaxial").model
COAXIAL_LAG: Final = vehicle_type("coaxial_lag").model
CRAZYFLIE: Final = vehicle_type("crazyflie").model

Knowledge = Literal["default", "learned", "identified", "exact"]
"""`default`: the type. `learned`: the type, until the vehicle has learned from its own ordinary flight, in
some experiments. `identified`: fitted to a flight of the vehicle; the type where the fit was refused.
`exact`: the true parameters."""

LEVELS: Final[tuple[Knowledge, ...]] = ("default", "identified", "exact")
"""Levels at which a flight can begin."""
LEARNED_LEVELS: Final[tuple[Knowledge, ...]] = ("default", "learned", "identified", "exact")
PROMPT_S: Final = 0.005  # servo lag of a vehicle without servos
EXCITED_S: Final = 70.0
SETTLING_S: Final = 6.0
REACH_M: Final = 0.4
PLACE_M: Final[Three] = (0.0, 0.0, 1.0)
"""Of the flight that an identification is fitted to: excitation, rest before it, room and place."""
LEARNED_FROM: Final = 9  # set points that a vehicle learns from, within `REACH_M` of its place
SLOT_S: Final = 7.0


class NotIdentifiedError(ValueError):
    """The excitation ended early; the message says why."""


def plant_type(conditions: Conditions) -> Model:
    """Vehicle type that experiments fly in these conditions.

    All but `COAXIAL_LAG` differ from equation (1), so that pilots may know more or less of them.
    """
    if conditions.attitude_plant != "first_order":
        return CRAZYFLIE
    return COAXIAL if conditions.coaxial_plant != "first_order" else COAXIAL_LAG


def known_model(
    knowledge: Knowledge, conditions: Conditions, name: str, seed: int, measured_tilt: bool = True
) -> Model:
    """Model that a pilot gets of a vehicle of the conditions' type.

    `measured_tilt`: whether an identification used roll and pitch. Raises `ValueError`: knowledge of
    first-order plants.
    """
    nominal = plant_type(conditions)
    if knowledge in ("default", "learned"):
        return nominal
    if nominal is COAXIAL_LAG:
        raise ValueError(f"knowledge {knowledge!r}: first-order plants are known by default only")
    if knowledge == "identified":
        return identified_model(conditions, name, seed, measured_tilt)
    if nominal is CRAZYFLIE:
        return exact_crazyflie(crazyflie_of(name, conditions, seed))
    exact = exact_model(helicopter_of(name, conditions, seed))
    return replace(exact, lever_arm_m=conditions.lever_arm_m)


def exact_model(parameters: HelicopterParameters) -> Model:
    """The model that a perfect identification of a simulated helicopter would find.

    Where the model is simpler than the vehicle it gets means: of servos and inertias of pitch and roll, of
    the lags of the two rotors, weighted by their thrust, and for yaw by their torque. Trim, markers and
    battery are not in it; they are estimated in flight.
    """
    thrust_n, lag_s = parameters.hover_thrusts_n, parameters.rotor_lag_s
    inertia = (parameters.inertia_kg_m2[0] + parameters.inertia_kg_m2[1]) / 2
    lever_n_m = thrust_n.lower * parameters.arm_m.lower + parameters.spring_n_m.lower
    tilt = TiltModel(
        frequency_rad_s=parameters.fast_mode_rad_s,
        damping_ratio=parameters.added_damping,
        servo_lag_s=sum(parameters.servo_lag_s) / 2,
        bar_time_constant_s=parameters.bar_time_constant_s,
        upper_phase_rad=parameters.hover_phases_rad.upper,
        lower_phase_rad=parameters.hover_phases_rad.lower - sum(parameters.servo_axes_rad) / 2,
        upper_share=thrust_n.upper * parameters.link.upper / (parameters.mass_kg * GRAVITY_M_S2),
        direct_m=thrust_n.lower * inertia / (parameters.mass_kg * lever_n_m),
        flapping_rad_s_m=parameters.flapping_rad_s_m * math.cos(parameters.flapping_phase_rad),
    )
    plateau_m_s2 = abs(parameters.plateau_per_swash)
    rotor_lag_s = (thrust_n.upper * lag_s.upper + thrust_n.lower * lag_s.lower) / sum(thrust_n)
    torque_upper = parameters.torque.upper * parameters.thrust.lower
    torque_lower = parameters.torque.lower * parameters.thrust.upper
    yaw_lag_s = (torque_upper * lag_s.upper + torque_lower * lag_s.lower) / (torque_upper + torque_lower)
    yaw_gain = parameters.yaw_rate_gain_rad_s * parameters.yaw_gyro_gain_per_s
    own_s = parameters.delay_s
    # Yaw acceleration of either rotor's drag per unit of thrust stick; in hover they cancel.
    drag = parameters.torque.upper * parameters.hover_speeds_rad_s.upper**2 * parameters.thrust_gain_m_s2
    drag_rad_s2 = drag / (parameters.inertia_kg_m2[2] * GRAVITY_M_S2)
    pitch_lag_s, roll_lag_s, _, _ = COAXIAL.lag_s
    return replace(
        COAXIAL,
        input_gain=(
            plateau_m_s2 * parameters.swash_gain_rad[0],
            plateau_m_s2 * parameters.swash_gain_rad[1],
            parameters.thrust_gain_m_s2,
            yaw_gain,
        ),
        damping=(-parameters.drag_per_s[0], -parameters.drag_per_s[1], 0.0, -parameters.yaw_gyro_gain_per_s),
        lag_s=(pitch_lag_s, roll_lag_s, rotor_lag_s, yaw_lag_s),
        delay_s=COAXIAL.delay_s if own_s is None else own_s,
        thrust_coupling=drag_rad_s2 * (lag_s.upper - lag_s.lower) / (yaw_gain * rotor_lag_s),
        tilt=tilt,
        uncertainty=_known(tilt),
    )


def _known(tilt: TiltModel) -> Uncertainty:
    """Uncertainty of a vehicle with a tilt that an identification found."""
    return replace(IDENTIFIED, tilt_damping=damping_range(tilt.damping_ratio))


def exact_crazyflie(vehicle: IdentifiedCrazyflie) -> Model:
    """The model that a perfect identification of a Crazyflie of `drone-models` would find."""
    true = vehicle.parameters()
    stiffness, rate_damping, pull = -true["rpy_coef"], -true["rpy_rates_coef"], true["cmd_rpy_coef"]
    tilt_gain = GRAVITY_M_S2 * FULL_TILT_RAD * pull[0] / stiffness[0]
    thrust_gain = FULL_THRUST_SHARE * true["thrust_max"] * true["cmd_f_coef"] / true["mass"]
    yaw_damping, tilt_lag_s = pull[2] / rate_damping[2], rate_damping[0] / stiffness[0]
    frequency_rad_s = math.sqrt(stiffness[0])
    tilt = TiltModel(frequency_rad_s, float(rate_damping[0]) / frequency_rad_s / 2, PROMPT_S)
    return replace(
        CRAZYFLIE,
        input_gain=four(np.array((tilt_gain, tilt_gain, thrust_gain, FULL_YAW_RATE_RAD_S * yaw_damping))),
        damping=four(np.array((*np.diag(true["drag_matrix"]) / true["mass"], -yaw_damping))),
        lag_s=four(np.array((tilt_lag_s, tilt_lag_s, true["thrust_time_coef"], 1 / rate_damping[2]))),
        hover_thrust=float(GRAVITY_M_S2 / thrust_gain),
        tilt=tilt,
        uncertainty=_known(tilt),
    )


def excited_flight(conditions: Conditions, name: str, seed: int, measured_tilt: bool) -> FlightRecording:
    """Excite a hovering vehicle of known type; return that part, `NotIdentifiedError` if it ends early."""
    estimator_settings, nominal = {"measured_tilt": measured_tilt}, plant_type(conditions)
    vehicle = RigVehicle(name, nominal, BodyPose(PLACE_M), "cascade", estimator_settings=estimator_settings)
    rig = Rig([vehicle], conditions, seed)
    rig.fly(SETTLING_S)
    pilot, log = rig.pilots[name], rig.log(name)
    excitation = excitation_for(nominal, EXCITED_S)
    pilot.exciter.begin(excitation, np.array(PLACE_M), REACH_M, pilot.clock.time_s)
    rig.fly(EXCITED_S)
    if pilot.exciter.outcome not in (UNDER_WAY, DONE):
        raise NotIdentifiedError(f"{name}, seed {seed}: {pilot.exciter.outcome}")
    recording = log.recording()
    return recording if measured_tilt else replace(recording, tilt=None)


def learn(rig: Rig, duration_s: float, events: Sequence[PilotEvent]) -> None:
    """Fly as in any flight, fit a model to it for every vehicle, and use these from then on."""
    logs = {name: rig.log(name) for name in rig.pilots}
    rig.fly(duration_s, events)
    for name, log in logs.items():
        found = identify(log.recording(), rig.pilots[name].model, ordinary=True)
        rig.use_model(name, fitted_parameters(found.model))


def learn_around(rig: Rig, place_m: Three, seed: int) -> None:
    """Let the vehicle `h1` learn from 70 s of set points around its place."""
    moves = np.random.default_rng(seed).uniform(-REACH_M, REACH_M, (LEARNED_FROM, 3))
    places = [*(place_m + moves), np.array(place_m)]
    steps = [GoToEvent(SLOT_S * number, "h1", tuple(place)) for number, place in enumerate(places)]
    learn(rig, SLOT_S * len(places), steps)


@lru_cache(maxsize=256)
def identified_model(conditions: Conditions, name: str, seed: int, measured_tilt: bool) -> Model:
    """Model that an identification found; that of the type where it was refused."""
    try:
        return identify(excited_flight(conditions, name, seed, measured_tilt), plant_type(conditions)).model
    except NotIdentifiedError:
        return plant_type(conditions)
