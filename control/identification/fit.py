"""Prediction-error fit of a vehicle's model to a flight.

Horizontal motion and height are fitted to the innovations of the stationary Kalman predictor of the model,
the heading to errors further ahead, because its model is coarser. Where the vehicle logged the sticks, their
times are coarser, and everything is fitted to errors further ahead. Prior knowledge of the type counts as
much as a measurement (`rcopterx.control.identification.parameters`), so that parameters that a flight does
not show keep their values. The last part of the flight is not fitted; it validates the result.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Final

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from rcopterx.control.identification.motions import (
    SETTLE_S,
    Candidate,
    Motion,
    Offsets,
    heading,
    horizontal,
    vertical,
)
from rcopterx.control.identification.parameters import (
    DAMPING,
    FREQUENCY,
    PITCH_GAIN,
    ROLL_GAIN,
    THRUST_GAIN,
    YAW_RATE_GAIN,
    Parameter,
    heading_parameters,
    horizontal_parameters,
    vertical_parameters,
)
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.vehicles.model import (
    DAMPING_FACTOR,
    IDENTIFIED,
    Model,
    Uncertainty,
    damping_range,
)
from rcopterx.vehicles.state import U_THRUST, Array, three
from rcopterx.vehicles.tuples import Two

FITTED_SHARE: Final = 0.8  # share of the flight that is fitted; the rest validates
SHORTEST_S: Final = 20.0
SHORTEST_PART_S: Final = 10.0  # of each of several flights
AHEAD_S: Final = 1.0
_OUTLIER: Final = 3.0  # residuals beyond so many deviations count less than their square
_NORMAL: Final = 1.4826  # standard deviation of a normal distribution over the median of its magnitude
_FARTHEST: Final = 4.0  # parameters stay within so many spreads of their prior values
_AT_BOUND: Final = 0.98 * _FARTHEST
_VANISHED_S: Final = max(IDENTIFIED.delay_s)  # shorter lags and delays are within the uncertainty
_EVALUATIONS: Final = 25
_START_FREQUENCIES: Final = (-2.8, -1.4, 0.0, 1.4, 2.8)  # tilt frequencies, in spreads from the known one
LEAST_CERTAIN: Final = 0.15  # largest relative deviation of gains and frequency of a usable excitation
_WORSE: Final = 1.25  # largest accepted ratio of errors, which by chance differ by less
_THREE_DEVIATIONS: Final = 3.0

_AXES: Final = ("horizontal motion", "height", "heading")
_GAINS: Final = ((PITCH_GAIN.name, ROLL_GAIN.name), (THRUST_GAIN.name,), (YAW_RATE_GAIN.name,))
_ESSENTIAL: Final = frozenset(parameter.name for parameter in (PITCH_GAIN, ROLL_GAIN, THRUST_GAIN, FREQUENCY))

Flights = Sequence[FlightRecording]
MotionOf = Callable[[Candidate, FlightRecording], Motion]


@dataclass(frozen=True)
class FittedParameter:
    """A number before and after, with its standard deviation."""

    name: str
    unit: str
    before: float
    value: float
    deviation: float


@dataclass(frozen=True)
class PredictionErrors:
    """Root mean square errors of predictions one second ahead; the horizontal one is per axis."""

    horizontal_m: float
    height_m: float
    yaw_rad: float


@dataclass(frozen=True)
class Identification:
    """Result of a fit."""

    model: Model  # the fitted model with its uncertainty
    offsets: Offsets  # trim and tilt of the markers in this flight
    parameters: tuple[FittedParameter, ...]
    # errors of the old and the new model in the part of the flight that was not fitted
    before: PredictionErrors
    after: PredictionErrors
    problems: tuple[str, ...]  # why the result must not be used; empty if it may be
    remarks: tuple[str, ...]  # what the flight does not show, so that the uncertainty is not narrowed


def identify(recording: FlightRecording, model: Model, *more: FlightRecording) -> Identification:
    """Fit a model to a flight of at least `SHORTEST_S` with all sticks excited, or to several together.

    Raises ValueError for less, a part shorter than `SHORTEST_PART_S`, or a flight of another type of vehicle.
    """
    flights = (recording, *more)
    _check(flights, model.kind)
    fitted = [flight.part(0.0, FITTED_SHARE) for flight in flights]
    hover = _hover_thrust(flights, model)
    logged = any(flight.logged for flight in flights)
    known = replace(model, gravity_m_s2=hover * model.input_gain[U_THRUST]) if logged else model
    start, fits = Candidate(known), []
    with_tilt = all(flight.tilt is not None for flight in flights)
    candidate = start
    for fit in (
        _horizontal_fit(candidate, with_tilt, logged),
        _Fit(vertical_parameters(logged), vertical, logged),
        _Fit(heading_parameters(model), heading, far=True),
    ):  # in the order of `Uncertainty`
        fits.append(fit.run(candidate, fitted))
        candidate = fits[-1].candidate
    by_axis = [fitted_part.numbers(start) for fitted_part in fits]
    numbers = tuple(number for of_axis in by_axis for number in of_axis)
    judged = [flight.part(FITTED_SHARE - SETTLE_S / flight.duration_s, 1.0) for flight in flights]
    before = prediction_errors(Candidate(model, candidate.offsets), judged)
    after = prediction_errors(candidate, judged)
    bounds = [fitted_part.at_bounds() for fitted_part in fits]
    essential = [
        f"{name} went as far as it may: the vehicle is not of this type, or the flight does not show it"
        for name in chain(*bounds)
        if name in _ESSENTIAL
    ]
    doubtful = [[name for name in at_bounds if name not in _ESSENTIAL] for at_bounds in bounds]
    problems = (*_too_little(numbers), *_worse(before, after), *essential)
    found = _finished(candidate.model, model, hover)
    uncertainty = _uncertainty(found, model, by_axis, [bool(names) for names in doubtful])
    return Identification(
        replace(found, uncertainty=uncertainty),
        candidate.offsets,
        numbers,
        before,
        after,
        problems,
        tuple(_doubtful(name, axis) for axis, names in zip(_AXES, doubtful, strict=True) for name in names),
    )


def _check(flights: Flights, kind: str) -> None:
    total_s = sum(flight.duration_s for flight in flights)
    if total_s < SHORTEST_S:
        raise ValueError(f"the recording lasts {total_s:.1f} s, at least {SHORTEST_S:g} s are needed")
    for flight in flights:
        if flight.duration_s < SHORTEST_PART_S:
            raise ValueError(
                f"a recording lasts {flight.duration_s:.1f} s, at least {SHORTEST_PART_S:g} s are needed"
            )
        if flight.kind != kind:
            raise ValueError(f"the recording is of a vehicle of type {flight.kind}, not {kind}")


def _hover_thrust(flights: Flights, model: Model) -> float:
    """Mean thrust stick; ValueError if full thrust is not above it."""
    hover = float(np.concatenate([flight.inputs[:, U_THRUST] for flight in flights]).mean())
    if not hover < model.input_max[U_THRUST]:
        raise ValueError(f"it flew with {hover:.2f} of full thrust on average: none is left to climb with")
    return hover


def prediction_errors(candidate: Candidate, flights: Flights) -> PredictionErrors:
    """Return the errors of predictions one second ahead in some flights."""

    def rms(motion_of: MotionOf) -> float:
        motions = [motion_of(candidate, flight) for flight in flights]
        errors = np.concatenate(
            [each.errors_ahead(round(AHEAD_S / each.period_s))[each.settled :] for each in motions]
        )
        return float(np.sqrt(np.mean(np.abs(errors) ** 2)))

    return PredictionErrors(rms(horizontal) / math.sqrt(2.0), rms(vertical), rms(heading))


def predicted_ahead(candidate: Candidate, recording: FlightRecording) -> Array:
    """Return poses predicted one second ahead, shape (K, 4): x, y, z [m], yaw [rad]; NaN at first."""
    periods = round(AHEAD_S / recording.period_s)
    measured = np.column_stack((recording.position_m, recording.yaw_rad))[periods:]
    plane = horizontal(candidate, recording).errors_ahead(periods)
    errors = np.column_stack(
        (
            plane.real,
            plane.imag,
            vertical(candidate, recording).errors_ahead(periods).real,
            heading(candidate, recording).errors_ahead(periods).real,
        )
    )
    return np.vstack((np.full((periods, 4), np.nan), measured - errors))


@dataclass(frozen=True)
class _Found:
    candidate: Candidate
    parameters: tuple[Parameter, ...]
    position: Array
    deviation: Array

    def at_bounds(self) -> list[str]:
        """Names of parameters on their bounds; a lag that became too short to matter is none."""
        return [
            one.name
            for one, position in zip(self.parameters, self.position, strict=True)
            if abs(position) >= _AT_BOUND and not (one.unit == "s" and one.read(self.candidate) < _VANISHED_S)
        ]

    def numbers(self, start: Candidate) -> list[FittedParameter]:
        numbers = []
        for parameter, deviation in zip(self.parameters, self.deviation, strict=True):
            value = parameter.read(self.candidate)
            scale = abs(value) if parameter.positive else 1.0
            spread = parameter.spread * scale * float(deviation)
            numbers.append(
                FittedParameter(parameter.name, parameter.unit, parameter.read(start), value, spread)
            )
        return numbers


@dataclass(frozen=True)
class _Fit:
    """Least squares over some parameters; positions are in spreads from the start."""

    parameters: tuple[Parameter, ...]
    motion: MotionOf
    far: bool  # whether errors further ahead are made small instead of the innovations
    begin_at: Sequence[Array] = ()

    def run(self, start: Candidate, flights: Flights) -> _Found:
        position = np.zeros(len(self.parameters))
        if self.begin_at:
            scales = self._scales(start, flights)
            costs = [np.sum(self._all(start, flights, scales, at) ** 2) for at in self.begin_at]
            position = self.begin_at[int(np.argmin(costs))]
        for _ in range(2):
            # Weights follow from the errors of the best model so far.
            scales = self._scales(self._at(start, position), flights)
            solved: OptimizeResult = least_squares(
                partial(self._all, start, flights, scales),
                position,
                bounds=(-_FARTHEST, _FARTHEST),
                loss="soft_l1",
                f_scale=_OUTLIER,
                max_nfev=_EVALUATIONS,
            )
            position = solved.x
        covariance = np.linalg.inv(solved.jac.T @ solved.jac)
        return _Found(self._at(start, position), self.parameters, position, np.sqrt(np.diag(covariance)))

    def _at(self, start: Candidate, position: Array) -> Candidate:
        candidate = start
        for parameter, moved in zip(self.parameters, position, strict=True):
            value, shift = parameter.read(start), parameter.spread * float(moved)
            moved_to = value * math.exp(shift) if parameter.positive else value + shift
            candidate = parameter.write(candidate, moved_to)
        return candidate

    def _errors(self, candidate: Candidate, flights: Flights) -> list[Array]:
        motions = [self.motion(candidate, flight) for flight in flights]
        errors = [each.far_errors() if self.far else each.settled_innovations() for each in motions]
        # Height and heading are real.
        parts = (np.real, np.imag) if self.motion is horizontal else (np.real,)
        return [
            np.concatenate([part(of_flight) for of_flight in kind for part in parts])
            for kind in zip(*errors, strict=True)
        ]

    def _scales(self, candidate: Candidate, flights: Flights) -> list[float]:
        """Deviation of each kind of errors, from their median so that outliers do not count."""
        return [_NORMAL * float(np.median(np.abs(part))) for part in self._errors(candidate, flights)]

    def _all(self, start: Candidate, flights: Flights, scales: list[float], position: Array) -> Array:
        errors = self._errors(self._at(start, position), flights)
        weighted = [part / scale for part, scale in zip(errors, scales, strict=True)]
        return np.concatenate((*weighted, position))


def _horizontal_fit(start: Candidate, with_tilt: bool, logged: bool) -> _Fit:
    parameters = horizontal_parameters(start.model, with_tilt)
    begin_at: list[Array] = []
    if FREQUENCY in parameters:
        place = np.array([parameter is FREQUENCY for parameter in parameters], dtype=float)
        begin_at = [spreads * place for spreads in _START_FREQUENCIES]
    return _Fit(parameters, horizontal, logged, begin_at)


def _finished(model: Model, before: Model, hover: float) -> Model:
    """Fitted model with derived values: hover thrust, equivalent lags."""
    lag_s = model.lag_s
    if model.tilt is not None and before.tilt is not None:
        slower = before.tilt.frequency_rad_s / model.tilt.frequency_rad_s
        lag_s = (lag_s[0] * slower, lag_s[1] * slower, *lag_s[2:])
    return replace(model, lag_s=lag_s, hover_thrust=hover)


def _uncertainty(
    model: Model, before: Model, numbers: Sequence[Sequence[FittedParameter]], doubtful: Sequence[bool]
) -> Uncertainty:
    """Uncertainty of a fitted model, by numbers and doubts of horizontal motion, height and heading.

    Gain and delay of an axis in doubt stay at least as uncertain as before. Frequency and damping stay as
    certain as the fit: no weights bear those of all vehicles of a type with the model of one.
    """
    certain = [
        {number.name: number.deviation / number.value for number in of_axis if number.value > 0.0}
        for of_axis in numbers
    ]
    known, gains, delays_s = before.uncertainty, list[float](), list[float]()
    for axis, names in enumerate(_GAINS):
        fitted = 1.0 + _THREE_DEVIATIONS * max(certain[axis].get(name, 0.0) for name in names)
        # Gains that are kept are known; with prior knowledge of the type no gain is less certain than its.
        gain = max(IDENTIFIED.gain_factor[axis], min(fitted, known.gain_factor[axis]))
        delay_s = IDENTIFIED.delay_s[axis]
        if doubtful[axis]:
            gain, delay_s = max(gain, known.gain_factor[axis]), max(delay_s, known.delay_s[axis])
        gains.append(gain)
        delays_s.append(delay_s)
    of_tilt = _THREE_DEVIATIONS * certain[0].get(FREQUENCY.name, 0.0)
    fraction, *others = IDENTIFIED.frequency_fraction
    fraction = max(fraction, of_tilt)
    return Uncertainty(
        three(np.array(gains)),
        three(np.array(delays_s)),
        (fraction, others[0], others[1]),
        _damping_range(model, before, certain[0].get(DAMPING.name, 0.0)),
        None if model.tilt is None else (gains[0], delays_s[0], fraction),
    )


def _damping_range(model: Model, before: Model, deviation: float) -> Two | None:
    """Range of the damping ratio around a fitted one with a relative deviation; at most as wide as before."""
    known = before.uncertainty.tilt_damping
    if model.tilt is None:
        return known
    factor = max(DAMPING_FACTOR, 1.0 + _THREE_DEVIATIONS * deviation)
    if known is not None and factor**2 > known[1] / known[0]:
        return known
    return damping_range(model.tilt.damping_ratio, factor)


def _too_little(numbers: Sequence[FittedParameter]) -> list[str]:
    return [
        f"too little excitation: {number.name} is known to within "
        f"{100 * number.deviation / number.value:.0f} % only, at most {100 * LEAST_CERTAIN:.0f} % is needed"
        for number in numbers
        if number.name in _ESSENTIAL and number.deviation > LEAST_CERTAIN * abs(number.value)
    ]


def _worse(before: PredictionErrors, after: PredictionErrors) -> list[str]:
    pairs = (
        ("horizontal motion", 1e3 * before.horizontal_m, 1e3 * after.horizontal_m, "mm"),
        ("height", 1e3 * before.height_m, 1e3 * after.height_m, "mm"),
        ("heading", 1e3 * before.yaw_rad, 1e3 * after.yaw_rad, "mrad"),
    )
    return [
        f"fit worse than before: {what} one second ahead off by {new:.0f} {unit} instead of {old:.0f} {unit}"
        for what, old, new, unit in pairs
        if new > _WORSE * old
    ]


def _doubtful(name: str, axis: str) -> str:
    return (
        f"{name} went as far as it may, so the gain of the {axis} counts as uncertain as before: the vehicle "
        "differs in something else, or sticks were at their ends; identify again with a lower --strength"
    )
