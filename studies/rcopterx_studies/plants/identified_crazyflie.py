"""Crazyflies as plants, as the package `drone-models` identified them from real flights.

Of its models `so_rpy_rotor_drag` contains the attitude control of the firmware, and its command is what a
Crazyflie gets by radio: roll, pitch, yaw and thrust. A model from first principles would need an attitude
controller of ours in between.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.disturbance import PARAMETERS, random_stream
from rcopterx.simulator.plant import CALM, BodyPose, PlantMaker, SteppedPlant, four
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Four, Three

if TYPE_CHECKING:
    import casadi

IDENTIFIED: Final = ("cf2x_L250", "cf2x_P250", "cf2x_T350", "cf21B_500")
"""Types that the package `drone-models` has identified."""
DRAWN: Final = "drawn"  # the kind of a vehicle drawn around these
MODEL: Final = "so_rpy_rotor_drag"
FULL_TILT_RAD: Final = math.radians(CrazyflieSettings().full_tilt_deg)
FULL_YAW_RATE_RAD_S: Final = math.radians(CrazyflieSettings().full_yaw_rate_deg_s)
FULL_THRUST_SHARE: Final = 4 * FULL_THRUST / 65535
"""Thrust command at full stick over the largest thrust of one of the four motors."""
SIZES: Final = {"state": 16, "command": 4, "gain": 1, "air": 4, "step_s": 1}  # arguments of a step
MISSING_LIBRARY: Final = "the library drone-models is not installed: pip install 'rcopterx-studies[physics]'"


@dataclass(frozen=True)
class IdentifiedCrazyflie:
    """One vehicle: an identified type, and how it differs from that."""

    drone: str  # name of the type in `drone-models`
    scales: tuple[tuple[str, float], ...] = ()  # factors of its parameters by their names there
    trim: Four = CALM  # offset of every stick
    marker_tilt_rad: tuple[float, float] = (0.0, 0.0)  # pitch and roll of the markers against the body

    def parameters(self) -> dict[str, Any]:
        """Parameters by the names of `drone-models`; raises `ModuleNotFoundError` without that package."""
        found: dict[str, Any] = _library().load_params(MODEL, self.drone)
        return found | {name: found[name] * factor for name, factor in self.scales}


def crazyflie_of(name: str, conditions: Conditions, seed: int) -> IdentifiedCrazyflie:
    """Vehicle of the conditions, by name and seed: an identified type with a drawn trim, or all of it drawn.

    A drawn one is of any of the types; it differs by up to 5 % in mass and 10 % in thrust (battery, markers),
    15 % in the stiffness and damping of its attitude and the lag of its thrust, 25 % in drag; its markers are
    tilted by up to 5 degrees. All uniform.
    """
    generator = random_stream(seed, name, PARAMETERS)
    drone = conditions.attitude_plant.partition(":")[2]
    trim = four(conditions.trim_offset * generator.uniform(-1.0, 1.0, 4))
    if drone in IDENTIFIED:
        return IdentifiedCrazyflie(drone, trim=trim)

    def spread(fraction: float) -> float:
        return float(generator.uniform(1 - fraction, 1 + fraction))

    drone = IDENTIFIED[generator.integers(len(IDENTIFIED))]
    stiffness = spread(0.15)
    scales = {
        "mass": spread(0.05),
        "cmd_f_coef": spread(0.10),
        "rpy_coef": stiffness,
        "cmd_rpy_coef": stiffness * spread(0.10),
        "rpy_rates_coef": spread(0.15),
        "thrust_time_coef": spread(0.15),
        "drag_matrix": spread(0.25),
    }
    tilt_rad, direction_rad = math.radians(generator.uniform(0.0, 5.0)), generator.uniform(-math.pi, math.pi)
    markers = tilt_rad * math.cos(direction_rad), tilt_rad * math.sin(direction_rad)
    return IdentifiedCrazyflie(drone, tuple(scales.items()), trim, markers)


def _library() -> Any:
    # The package refuses to be imported after scipy without this; it matters for other arrays than numpy's.
    os.environ.setdefault("SCIPY_ARRAY_API", "1")
    try:
        from drone_models import core
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(MISSING_LIBRARY) from error
    return core


class _Step:
    """One step of the explicit midpoint rule: state, command, gain, accelerations by air, duration -> state.

    The state is that of `drone-models` with angles: position, roll, pitch, yaw, velocity, rates of the
    angles, and thrust, four times. The model is evaluated in the frame of the vehicle's heading: its yaw is 0
    there, and its yaw command the error of the heading that the firmware wants, so that it flies alike in all
    directions.

    Its symbolic equations are evaluated by casadi: on numpy arrays they cost a hundred times as much.
    """

    def __init__(self, vehicle: IdentifiedCrazyflie) -> None:
        self._buffer: Any
        self._buffer, self._evaluate = _function(vehicle).buffer()
        self._arguments = [np.zeros(size) for size in SIZES.values()]
        self._after = np.zeros(SIZES["state"])
        for index, argument in enumerate(self._arguments):
            self._buffer.set_arg(index, argument.data)
        self._buffer.set_res(0, self._after.data)

    def __call__(self, *arguments: Sequence[float]) -> list[float]:
        for own, given in zip(self._arguments, arguments, strict=True):
            own[:] = given
        self._evaluate()
        after: list[float] = self._after.tolist()
        return after


@lru_cache(maxsize=64)
def _function(vehicle: IdentifiedCrazyflie) -> casadi.Function:
    core = _library()
    import casadi
    from drone_models.so_rpy_rotor_drag import model

    symbolic = core.parametrize(model.symbolic_dynamics_euler, vehicle.drone)
    derivative, x, u, _ = symbolic(
        **{name: symbolic.keywords[name] * factor for name, factor in vehicle.scales}
    )
    of_model = casadi.Function("of_model", [x, u], [derivative])
    state, command, gain, air, step_s = (casadi.MX.sym(name, size) for name, size in SIZES.items())

    def rate(state: Any) -> Any:
        yaw = state[5]
        cosine, sine = casadi.cos(yaw), casadi.sin(yaw)
        turn = casadi.vertcat(casadi.horzcat(cosine, -sine), casadi.horzcat(sine, cosine))
        in_heading = casadi.vertcat(state[:5], 0, turn.T @ state[6:8], state[8:])
        change = of_model(in_heading, casadi.vertcat(command[:2], command[2] - yaw, command[3]))
        moved = casadi.vertcat(turn @ change[6:8], change[8], gain * change[9:11], change[11])
        return casadi.vertcat(state[6:12], moved + casadi.vertcat(air[:3], 0, 0, air[3]), change[12:])

    after = state + step_s * rate(state + step_s / 2 * rate(state))
    return casadi.Function("step", [state, command, gain, air, step_s], [after]).expand()


class CrazyfliePlant(SteppedPlant):
    """A Crazyflie of `drone-models` behind its firmware, which gets tilt, yaw rate and thrust; see `vehicle`.

    Full sticks are those of the type `crazyflie`. Raises `ModuleNotFoundError` without the package.
    """

    def __init__(
        self, name: str, model: Model, conditions: Conditions, seed: int, start: BodyPose,
        vehicle: IdentifiedCrazyflie,
    ) -> None:  # fmt: skip
        self.vehicle = vehicle
        self._step = _Step(vehicle)
        self._state = SIZES["state"] * [0.0]
        self._parameters = parameters = vehicle.parameters()
        self._full_thrust_n = FULL_THRUST_SHARE * float(parameters["thrust_max"])
        super().__init__(name, model, conditions, seed, start)

    @property
    def motion(self) -> tuple[float, ...]:
        """True motion state in the order of `rcopterx.vehicles.state`, eight numbers, yaw unwrapped."""
        x, y, z, _, _, yaw, vx, vy, vz, _, _, yaw_rate = self._state[:12]
        cosine, sine = math.cos(yaw), math.sin(yaw)
        return x, y, z, yaw, cosine * vx + sine * vy, cosine * vy - sine * vx, vz, yaw_rate

    @property
    def pose(self) -> BodyPose:
        """True pose of the body, yaw unwrapped."""
        x, y, z, roll, pitch, yaw = self._state[:6]
        return BodyPose((x, y, z), yaw, pitch, roll)

    @property
    def marker_pose(self) -> BodyPose:
        """Pose of the markers, which do not sit straight on the body, yaw unwrapped."""
        x, y, z, roll, pitch, yaw = self._state[:6]
        pitch_rad, roll_rad = self.vehicle.marker_tilt_rad
        return BodyPose((x, y, z), yaw, pitch + pitch_rad, roll + roll_rad)

    def _settle(self) -> None:
        self._state[12:] = 4 * [self._commanded_n()]

    def _stop(self, position_m: Three, yaw_rad: float) -> None:
        self._state = [*position_m, 0.0, 0.0, yaw_rad, *6 * [0.0], *self._state[12:]]
        self._heading_rad = yaw_rad  # the firmware wants the present heading

    def _command(self, sticks: Four | None) -> None:
        trim = CALM if sticks is None else self.vehicle.trim
        pitch, roll, thrust, yaw = (u + offset for u, offset in zip(sticks or CALM, trim, strict=True))
        self._target = FULL_TILT_RAD * pitch, -FULL_TILT_RAD * roll, thrust, FULL_YAW_RATE_RAD_S * yaw

    def _commanded_n(self) -> float:
        return min(max(self._target[2], 0.0), 1.0) * self._full_thrust_n * self._thrust_factor

    def _advanced(self, step_s: float, air: Four) -> list[float]:
        pitch, roll, _, _ = self._target
        command = roll, pitch, self._heading_rad, self._commanded_n()
        return self._step(self._state, command, (self.faults.attitude_gain,), air, (step_s,))

    def _stand(self, step_s: float) -> float:
        self._state[12:] = self._advanced(step_s, CALM)[12:]
        self._stop(self.position_m, self._state[5])
        lift_n = self._parameters["acc_coef"] + self._parameters["cmd_f_coef"] * self._state[-1]
        return float(lift_n / self._parameters["mass"])

    def _fly(self, step_s: float, weather: Four) -> None:
        self._heading_rad += step_s * self._target[3]
        self._state = self._advanced(step_s, weather)


def plant_of_kind(kind: str) -> PlantMaker:
    """Return what makes Crazyflies of an identified type, or drawn ones; `ValueError` without the package."""
    if kind not in (*IDENTIFIED, DRAWN):
        raise ValueError(f"unknown kind {kind!r}; allowed: {', '.join((*IDENTIFIED, DRAWN))}")
    if find_spec("drone_models") is None:
        raise ValueError(MISSING_LIBRARY)

    def made(name: str, model: Model, conditions: Conditions, seed: int, start: BodyPose) -> CrazyfliePlant:
        return CrazyfliePlant(name, model, conditions, seed, start, crazyflie_of(name, conditions, seed))

    return made
