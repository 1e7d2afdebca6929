"""Kalman filter for the horizontal motion of a vehicle with a tilt model, in the inertial frame.

    position, velocity, core of the tilt model, servo, wind, trim, offset of the body frame

The offset says how the measured body stands on the axis of the thrust: markers are never glued on straight.
It and the trim turn with the body; everything else but the servo is an inertial vector whose dynamics know no
heading, so the matrices of a period are computed once and only the columns of the body-fixed states turn.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import expm

from rcopterx.control.interfaces import TiltEstimate
from rcopterx.control.models.lateral import (
    POSITION,
    VELOCITY,
    WIND_CORRELATION_S,
    LateralSystem,
    lateral_system,
)
from rcopterx.control.models.linear import PERIOD_DIGITS, ByPeriod
from rcopterx.native.kalman import correct_tilt
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, heading_matrix

TRIM_LIMIT: Final = 0.3
OFFSET_LIMIT_RAD: Final = 0.2
WIND_LIMIT_M_S2: Final = 1.5
TILT_GATE: Final = 0.3
"""A measured tilt further than this from the predicted one is left out, as of markers mixed up."""
LEVEL_FLOOR_RAD: Final = 0.02
"""How level floor and landing gear are taken to be: a standing vehicle shows the offset of its body frame."""

_NO_TILT: Final = np.zeros(2)
_ANY_PERIOD_S: Final = 0.02
"""Where the states are does not depend on the period."""
_START_POSITION_M: Final = 0.001
_START_TILT: Final = 0.03
_START_RATE: Final = 0.3
_START_SERVO: Final = 0.02
_START_TRIM: Final = 0.03
_START_OFFSET_RAD: Final = 0.05
_TRIM_DENSITY: Final = 0.002
_OFFSET_DENSITY: Final = 0.0005
_SERVO_DENSITY: Final = 0.01


class TiltPeriod(NamedTuple):
    """What the prediction of a period needs to know, in the order in which `predict_tilt` takes it."""

    transition: Array
    demand: Array
    process: Array
    gain: Array
    pole: float
    moving: int


class TiltFilter:
    """The filter; all accelerations in m/s^2, tilts as horizontal components of an axis.

    Others may run beside it that never take in a tilt: they say what positions alone let expect. What is
    asked, is asked of the one that is believed.

    Parameters
    ----------
    model
        The vehicle; it has a tilt model.
    position_noise_m, tilt_noise
        Standard deviations of what is measured, at least.
    velocity_density, tilt_density
        Random-walk densities of velocity [m/s] and tilt rate [1/s] per root second: where the model is wrong.
    wind_rms_m_s2
        Standard deviation of the wind's acceleration.
    blind
        How many others run beside it.

    Attributes
    ----------
    states, covariances
        Of the filter and those beside it, shapes (k, n) and (k, n, n), which kernels change in place.
    believed
        Number of the one that is believed.
    least_noise
        Standard deviations of position and tilt, at least, shape (2,).
    noise_variances
        Variances that they are taken to have, shape (2,).
    state_limit
        States stay within plus and minus these, shape (n,).
    tilted
        First of the two states that are the tilt.
    periods
        What predictions of periods need to know.
    """

    def __init__(
        self,
        model: Model,
        position_noise_m: float,
        tilt_noise: float,
        velocity_density: float,
        tilt_density: float,
        wind_rms_m_s2: float,
        blind: int = 0,
    ) -> None:
        self._model = model
        self.least_noise: Array = np.array((position_noise_m, tilt_noise))
        self.noise_variances: Array = np.square(self.least_noise)
        self._velocity_density, self._tilt_density = velocity_density, tilt_density
        self._wind_rms_m_s2 = wind_rms_m_s2
        system = lateral_system(model, _ANY_PERIOD_S)
        self._core, self._servo, self._wind = system.core, system.servo, system.wind
        self._tilt_rate, self.tilted = system.tilt_rate, system.tilt.start
        self._trim = slice(system.size, system.size + 2)
        self._offset = slice(system.size + 2, system.size + 4)
        self._size = system.size + 4
        self.states: Array = np.zeros((1 + blind, self._size))
        self.covariances: Array = np.zeros((1 + blind, self._size, self._size))
        self.periods: ByPeriod[TiltPeriod] = ByPeriod(self._prepared)
        # What is asked, is asked of the filter that is believed.
        self._state: Array
        self._covariance: Array
        self.believe(0)
        self.tilts_left_out = 0
        """Measured tilts too far from the predicted one."""
        # What stays the same from step to step is prepared: the matrices are small and the steps many.
        self.state_limit: Array = np.full(self._size, np.inf)
        self.state_limit[self._trim], self.state_limit[self._offset] = TRIM_LIMIT, OFFSET_LIMIT_RAD
        self.state_limit[self._wind] = WIND_LIMIT_M_S2
        self._forget_body()

    def believe(self, number: int) -> None:
        """Ask the filter itself (0) or another one from now on."""
        self.believed = number
        self._state, self._covariance = self.states[number], self.covariances[number]

    @property
    def state(self) -> Array:
        """All states, beginning with the position, as they are now, shape (n,)."""
        return self._state

    @property
    def position_m(self) -> Array:
        """Estimated position, inertial frame, shape (2,)."""
        return self._state[POSITION]

    @property
    def horizontal(self) -> Array:
        """Estimated position and velocity, inertial frame, shape (4,)."""
        return self._state[: VELOCITY.stop]

    @property
    def expected_tilt(self) -> Array:
        """Horizontal components of the axis of the thrust that positions alone let expect, inertial frame,
        shape (2,); the others know it."""
        return self.states[-1, self.tilted : self.tilted + 2]

    @property
    def body_offset_rad(self) -> Array:
        """Estimated tilt of the measured body frame against the axis of the thrust, body frame, shape
        (2,)."""
        return self._state[self._offset]

    @property
    def variances(self) -> Array:
        """Of a measured position and of a measured tilt, shape (4,)."""
        return np.repeat(self.noise_variances, 2)

    @property
    def covariance(self) -> Array:
        """Covariance of all states, shape (n, n)."""
        return self._covariance

    @property
    def estimate(self) -> TiltEstimate:
        """What is known of the tilt; it stays what it was when the filter moves on."""
        return self.estimate_of(self._state.copy())

    def estimate_of(self, state: Array) -> TiltEstimate:
        """What a state says of the tilt; parts of it, shape (n,)."""
        return TiltEstimate(state[self._core], state[self._servo], state[self._wind], state[self._trim])

    def start(self, position_m: Array, velocity_m_s: Array, tilt: Array | None, yaw_rad: float) -> None:
        """Begin anew in the air; what is known of trim and body frame is kept.

        Parameters
        ----------
        position_m, velocity_m_s
            Inertial frame, shape (2,).
        tilt
            Measured tilt, None where it is not measured.
        yaw_rad
            Heading.
        """
        states = self.states
        states[:, POSITION], states[:, VELOCITY] = position_m, velocity_m_s
        states[:, self._core] = states[:, self._wind] = 0.0
        if tilt is not None:
            axis = tilt - heading_matrix(yaw_rad) @ states[0, self._offset]
            for place in range(self._core.start, self._core.stop, 2):
                if place != self._tilt_rate.start:
                    states[0, place : place + 2] = axis
        deviation = np.zeros(self._size)
        deviation[POSITION], deviation[VELOCITY] = _START_POSITION_M, 0.3
        deviation[self._core], deviation[self._tilt_rate] = _START_TILT, _START_RATE
        deviation[self._servo], deviation[self._wind] = _START_SERVO, self._wind_rms_m_s2
        body = slice(self._trim.start, None)
        kept = self.covariances[:, body, body].copy()
        self.covariances[:] = np.diag(deviation**2)
        self.covariances[:, body, body] = kept

    def stand(self, position_m: Array, tilt: Array | None, yaw_rad: float) -> None:
        """Begin anew at rest on the floor, which shows how the markers are glued on; arguments of `start`."""
        self._forget_body()
        if tilt is not None:
            offset = heading_matrix(yaw_rad).T @ tilt
            self.states[0, self._offset] = np.clip(offset, -OFFSET_LIMIT_RAD, OFFSET_LIMIT_RAD)
            self.covariances[0, self._offset, self._offset] = LEVEL_FLOOR_RAD**2 * np.eye(2)
        self.start(position_m, np.zeros(2), tilt, yaw_rad)

    def take_over(self, known: TiltEstimate) -> None:
        """Go on from what another filter knew; to be called after `start`."""
        states = self.states
        states[:, self._core], states[:, self._servo] = known.core, known.servo
        states[:, self._wind], states[:, self._trim] = known.wind_m_s2, known.trim

    def settle(self, stick: Array) -> None:
        """The servo has settled on a stick, shape (2,)."""
        self.states[:, self._servo] = stick + self.states[:, self._trim]

    def rest(self, stick: Array, period_s: float) -> None:
        """Let a period pass on the floor: only the servo moves."""
        target = stick + self.states[:, self._trim]
        pole = self.periods[round(period_s, PERIOD_DIGITS)].pole
        self.states[:, self._servo] = target + pole * (self.states[:, self._servo] - target)

    def _prepared(self, period_s: float) -> TiltPeriod:
        system = lateral_system(self._model, period_s)
        return TiltPeriod(
            np.ascontiguousarray(system.transition),
            np.ascontiguousarray(system.demand),
            self.process_noise(system),
            self._model.b,
            system.servo_pole,
            self._core.stop,
        )

    def correct(self, position_m: Array, tilt: Array | None, yaw_rad: float) -> None:
        """Take in what was measured; arguments of `start`, of which the first two entries count."""
        measured = tilt is not None
        position_variance, tilt_variance = self.noise_variances.tolist()
        taken_in, definite = correct_tilt(
            self.states,
            self.covariances,
            position_m,
            _NO_TILT if tilt is None else tilt,
            measured,
            yaw_rad,
            position_variance,
            tilt_variance,
            self.tilted,
            self.state_limit,
            TILT_GATE,
        )
        self.tilts_left_out += measured and not taken_in
        if not definite:
            raise np.linalg.LinAlgError("the covariance of the tilt filter is not positive definite")

    def forget_offset(self) -> None:
        """The body frame is not known any more, as what was measured of the tilt was wrong."""
        covariance = self.covariances[0]
        self.states[0, self._offset] = 0.0
        covariance[self._offset, :] = covariance[:, self._offset] = 0.0
        covariance[self._offset, self._offset] = _START_OFFSET_RAD**2 * np.eye(2)

    def _forget_body(self) -> None:
        """Trim and body frame as of a vehicle never seen before."""
        covariances, body = self.covariances, slice(self._trim.start, None)
        self.states[:, self._trim] = self.states[:, self._offset] = 0.0
        covariances[:, body, :] = covariances[:, :, body] = 0.0
        covariances[:, self._trim, self._trim] = _START_TRIM**2 * np.eye(2)
        covariances[:, self._offset, self._offset] = _START_OFFSET_RAD**2 * np.eye(2)

    def process_noise(self, system: LateralSystem) -> Array:
        """Covariance that a period adds, shape (n, n); the same for every heading."""
        return _process_noise(system, self._velocity_density, self._tilt_density, self._wind_rms_m_s2)


@lru_cache(maxsize=256)
def _process_noise(
    system: LateralSystem, velocity_density: float, tilt_density: float, wind_rms_m_s2: float
) -> Array:
    """Van Loan's integral, kept because preparing it takes longer than a step."""
    size = system.size
    density = np.zeros(size)
    density[VELOCITY] = velocity_density**2
    density[system.tilt_rate] = tilt_density**2
    density[system.wind] = 2.0 * wind_rms_m_s2**2 / WIND_CORRELATION_S
    both = np.block([[-system.continuous, np.diag(density)], [np.zeros((size, size)), system.continuous.T]])
    step = expm(system.period_s * both)
    noise = np.zeros((size + 4, size + 4))
    noise[:size, :size] = step[size:, size:].T @ step[:size, size:]
    slow = [_SERVO_DENSITY] * 2, [_TRIM_DENSITY] * 2, [_OFFSET_DENSITY] * 2
    places = [*range(system.servo.start, system.servo.stop), *range(size, size + 4)]
    noise[places, places] += system.period_s * np.square(np.concatenate(slow))
    return noise
