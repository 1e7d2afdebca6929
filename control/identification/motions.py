"""Horizontal motion, height and heading of a model as linear systems with their inputs and measurements.

A stationary Kalman predictor covers a whole flight at once. The horizontal motion of a vehicle is isotropic
(`rcopterx.vehicles.tilt`), so that the two components of every vector become one complex number, x + i y.
Height and heading are real systems.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.signal import lfilter

from rcopterx.control.identification.recording import FlightRecording
from rcopterx.control.models.lags import behind_lag
from rcopterx.control.models.lateral import WIND_CORRELATION_S, LateralSystem
from rcopterx.control.models.linear import Complex, as_complex, steady_filter, zero_order_hold
from rcopterx.vehicles.model import CALM, Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW, Array, Z


@dataclass(frozen=True)
class LinearSystem:
    """Continuous system dx/dt = A x + B u, y = C x, of shapes (n, n), (n,), (m, n), with one input.

    The variances, of shapes (n,) and (m,), are of the process (squared density) and the measurement.
    """

    a: Complex
    b: Complex
    c: Complex
    process_variance: Array
    measurement_variance: Array


EVERY_ROW: Final = slice(None)
SETTLE_S: Final = 2.0  # errors count from here on: predictors start without knowledge of the wind
_FAR_AHEAD_S: Final = (0.2, 1.0)
_FAR_EVERY_S: Final = 0.3
_USUAL: Final = 0.98  # share of innovations that are no outliers


class Motion:
    """A motion of a flight, inputs (K,) and measurements (K, m), predicted by a stationary Kalman filter."""

    def __init__(
        self, system: LinearSystem, period_s: float, delay_s: float, inputs: Complex, measured: Complex
    ) -> None:
        self.period_s, self._inputs, self._measured = period_s, inputs, measured
        self._whole_periods = int(delay_s / period_s)
        late_s = delay_s - self._whole_periods * period_s
        self._a, _ = zero_order_hold(system.a, system.b, period_s)
        self._c = system.c
        rest, self._newest = zero_order_hold(system.a, system.b, period_s - late_s)
        self._older = rest @ zero_order_hold(system.a, system.b, late_s)[1]
        process = period_s * np.diag(system.process_variance).astype(complex)
        noise = np.diag(system.measurement_variance).astype(complex)
        covariance, self._gain = steady_filter(self._a, system.c, process, noise)
        self._expected: Complex = system.c @ covariance @ system.c.conj().T + noise

    def _states(self) -> Complex:
        """States predicted one period ahead, shape (K, n)."""
        start = np.linalg.lstsq(self._c, self._measured[0], rcond=None)[0]
        correction = self._a @ self._gain
        driven = self._push() + self._measured @ correction.T
        # In its own modes the predictor is a handful of scalar recursions.
        values, vectors = np.linalg.eig(self._a - correction @ self._c)
        back = np.linalg.inv(vectors)
        modes, begun = (driven @ back.T).T, back @ start
        for mode, value in enumerate(values):
            modes[mode], _ = lfilter([0.0, 1.0], [1.0, -value], modes[mode], zi=[begun[mode]])
        return np.asarray(modes.T @ vectors.T)

    def innovations(self) -> Complex:
        """Return the one-period prediction errors, shape (K, m)."""
        return self._measured - self._states() @ self._c.T

    def improbability(self) -> float:
        """Return the mean negative log likelihood of innovations without outliers, up to a constant."""
        found = self.innovations()[self.settled :]
        squares = np.einsum("ki,ij,kj->k", found.conj(), np.linalg.inv(self._expected), found).real
        usual = np.sort(squares)[: round(_USUAL * len(squares))]
        return float(usual.mean() + np.linalg.slogdet(self._expected)[1])

    def ahead(self, periods: int, rows: slice = EVERY_ROW) -> Complex:
        """Return outputs predicted `periods` ahead with the recorded inputs, shape (K - periods, m)."""
        states = self._states()
        states = states + (self._measured - states @ self._c.T) @ self._gain.T
        push, count = self._push(), len(self._inputs) - periods
        states = states[:count][rows]
        for step in range(periods):
            states = states @ self._a.T + push[step : step + count][rows]
        return np.asarray(states @ self._c.T)

    def errors_ahead(self, periods: int, rows: slice = EVERY_ROW) -> Complex:
        """Return the errors of the first measurement in predictions of `ahead`, shape (K - periods,)."""
        return self._measured[periods:, 0][rows] - self.ahead(periods, rows)[:, 0]

    @property
    def settled(self) -> int:
        """Row from which on errors count."""
        return round(SETTLE_S / self.period_s)

    def far_errors(self) -> list[Complex]:
        """Return errors further ahead that count, thinned out; equally many of each distance."""
        rows = slice(self.settled, None, round(_FAR_EVERY_S / self.period_s))
        return [self.errors_ahead(round(ahead_s / self.period_s), rows) for ahead_s in _FAR_AHEAD_S]

    def _push(self) -> Complex:
        """Contribution of the inputs to the state in every period, shape (K, n)."""
        before = np.full(self._whole_periods + 1, self._inputs[0])
        delayed = np.concatenate((before, self._inputs))
        count = len(self._inputs)
        return np.outer(delayed[1 : count + 1], self._newest) + np.outer(delayed[:count], self._older)


POSITION_NOISE_M: Final = 0.0005
YAW_NOISE_RAD: Final = 0.003
TILT_NOISE: Final = 0.003
_RATE_DENSITY: Final = 0.1
"""Errors of the tilt model as a random walk of the tilt rate. A larger value biases frequency and servo lag
upwards, because the fit then trusts single noisy tilts."""
_FLAPPING_RATE_DENSITY: Final = 0.35  # the same with flapping, which else explains waits for radio frames
_SERVO_DENSITY: Final = 0.01
_ACTUATOR_DENSITY: Final = 0.001
WIND_M_S2: Final = 0.15
VERTICAL_WIND_M_S2: Final = 0.1
YAW_WIND_RAD_S2: Final = 0.5
_VERTICAL_DRIFT: Final = 0.03
_YAW_DRIFT: Final = 0.05


@dataclass(frozen=True)
class Offsets:
    """Trim of pitch and roll stick, tilt of the body frame against the thrust; thrust changes `per_volt`."""

    trim: tuple[float, float] = (0.0, 0.0)
    body_rad: tuple[float, float] = (0.0, 0.0)
    per_volt: float = 0.0


@dataclass(frozen=True)
class Candidate:
    """Model and offsets that a fit supposes."""

    model: Model
    offsets: Offsets = field(default_factory=Offsets)


def horizontal(candidate: Candidate, recording: FlightRecording) -> Motion:
    """Return the horizontal motion; measured are the position and, where available, the tilt."""
    model, offsets = candidate.model, candidate.offsets
    # A stick acts on the heading that the vehicle has by then, half a period later on average.
    time_s = recording.period_s * np.arange(len(recording.yaw_rad))
    acts_s = time_s + model.delay_s + 0.5 * recording.period_s
    acting = np.exp(1j * np.interp(acts_s, time_s, recording.yaw_rad))
    pitch = recording.inputs[:, U_PITCH] + offsets.trim[0]
    roll = recording.inputs[:, U_ROLL] + offsets.trim[1]
    demand = acting * (model.b[U_PITCH] * pitch + 1j * model.b[U_ROLL] * roll)
    measured = [_complex(recording.position_m[:, :2])]
    if recording.tilt is not None and model.tilt is not None:
        measured.append(
            _complex(recording.tilt) - np.exp(1j * recording.yaw_rad) * complex(*offsets.body_rad)
        )
    system = _horizontal_system(model, recording.period_s, with_tilt=len(measured) > 1)
    return Motion(system, recording.period_s, model.delay_s, demand, np.column_stack(measured))


def vertical(candidate: Candidate, recording: FlightRecording) -> Motion:
    """Return the motion in height; a battery that was measured takes part of the thrust as it runs down."""
    model = candidate.model
    system = _single_axis(model, U_THRUST, POSITION_NOISE_M, VERTICAL_WIND_M_S2, _VERTICAL_DRIFT)
    thrust = recording.inputs[:, U_THRUST]
    if (volts := recording.battery_v) is not None:
        # Every climb makes the voltage sag; the trend over the flight is the charge.
        trend = np.polynomial.Polynomial.fit(range(len(volts)), volts, 1)(np.arange(len(volts)))
        thrust = thrust * (1.0 + candidate.offsets.per_volt * (trend - trend.mean()))
    return _of_single_axis(model, recording, system, thrust, recording.position_m[:, Z])


def heading(candidate: Candidate, recording: FlightRecording) -> Motion:
    """Return the motion of the heading; thrust not yet followed by the rotors counts as yaw stick, too."""
    model = candidate.model
    system = _single_axis(model, U_YAW, YAW_NOISE_RAD, YAW_WIND_RAD_S2, _YAW_DRIFT)
    stick = recording.inputs[:, U_YAW]
    if model.thrust_coupling:
        stick = stick + model.thrust_coupling * _not_followed(model, recording)
    return _of_single_axis(model, recording, system, stick, recording.yaw_rad)


def _not_followed(model: Model, recording: FlightRecording) -> Array:
    """Thrust stick minus what the rotors have followed, mean of each period; they start settled."""
    thrust, periods = recording.inputs[:, U_THRUST], recording.period_s / max(model.lag_s[U_THRUST], 1e-3)
    pole = np.exp(-periods)
    changes = np.diff(thrust, prepend=thrust[0])
    return np.asarray((1.0 - pole) / periods * lfilter([1.0], [1.0, -pole], changes))


def _of_single_axis(
    model: Model, recording: FlightRecording, system: LinearSystem, stick: Array, measured: Array
) -> Motion:
    # The mean stick keeps the vehicle at rest. Gravity and trim would be offsets that the slow drift of the
    # disturbance takes long to find.
    stick = stick - stick.mean()
    inputs, outputs = stick.astype(complex), measured[:, None].astype(complex)
    return Motion(system, recording.period_s, model.delay_s, inputs, outputs)


def _horizontal_system(model: Model, period_s: float, with_tilt: bool) -> LinearSystem:
    """Position, velocity, core of the tilt model, servo, wind; without tilt model the lag is the servo."""
    if model.tilt is None:
        a, b = _plane_behind_lag(model)
        servo, wind, rate = 2, 3, []
    else:
        lateral = LateralSystem(model, period_s)
        a, b = as_complex(lateral.continuous), as_complex(lateral.continuous_demand)[:, 0]
        servo, wind, rate = lateral.servo.start // 2, lateral.wind.start // 2, [lateral.tilt_rate.start // 2]
    c = np.eye(3, len(b), dtype=complex)[[0, 2] if with_tilt else [0]]
    if model.tilt is not None:
        c[0, 2] = model.lever_arm_m
    density = np.zeros(len(b))
    flaps = model.tilt is not None and model.tilt.flapping_rad_s_m > 0.0
    density[1], density[servo] = model.gust_density, _SERVO_DENSITY
    density[rate] = _FLAPPING_RATE_DENSITY if flaps else _RATE_DENSITY
    density[wind] = WIND_M_S2 * np.sqrt(2.0 / WIND_CORRELATION_S)
    noise = np.array([POSITION_NOISE_M, TILT_NOISE])[: len(c)]
    return LinearSystem(a, b, c, density**2, noise**2)


def _plane_behind_lag(model: Model) -> tuple[Complex, Complex]:
    """Position, velocity, servo, wind of a vehicle without tilt model: A and B."""
    lag_s = max(0.5 * sum(model.lag_s[:2]), 1e-3)
    a = np.zeros((4, 4), complex)
    a[0, 1] = 1.0
    a[1, 1:] = 0.5 * sum(model.damping[:2]), 1.0, 1.0
    a[2, 2], a[3, 3] = -1.0 / lag_s, -1.0 / WIND_CORRELATION_S
    b = np.zeros(4, complex)
    b[2] = 1.0 / lag_s
    return a, b


def _single_axis(model: Model, axis: int, noise: float, wind: float, drift: float) -> LinearSystem:
    """Position, rate, actuator, wind and a slowly drifting offset of one axis."""
    lag_s = max(model.lag_s[axis], 1e-3)
    a, b = (part.astype(complex) for part in behind_lag(model, axis, lag_s, disturbances=2))
    a[3, 3] = -1.0 / WIND_CORRELATION_S
    gust = wind * np.sqrt(2.0 / WIND_CORRELATION_S)
    density = np.array([0.0, CALM, _ACTUATOR_DENSITY, gust, drift])
    return LinearSystem(a, b, np.eye(1, 5, dtype=complex), density**2, np.array([noise**2]))


def _complex(vectors: Array) -> Complex:
    return np.asarray(vectors[:, 0] + 1j * vectors[:, 1])
