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
from typing import Final

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from rcopterx.control.identification.motions import SETTLE_S, Candidate, Motion, heading, horizontal, vertical
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
from rcopterx.control.identification.result import (
    HEADING,
    HEIGHT,
    HORIZONTAL,
    PARTS,
    FittedParameter,
    FittedPart,
    Identification,
)
from rcopterx.vehicles.model import CALM, DAMPING_FACTOR, IDENTIFIED, Model, Uncertainty, damping_range
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
_LIKELIER: Final = 0.03  # log likelihood per period by which a lever arm must explain a flight better
_GUSTS: Final = (CALM, 2.0 * CALM, 5.0 * CALM, 10.0 * CALM)
_START_FREQUENCIES: Final = (-2.8, -1.4, 0.0, 1.4, 2.8)  # tilt frequencies, in spreads from the known one
WORSE: Final = 1.25  # largest accepted ratio of errors, which by chance differ by less
_THREE_DEVIATIONS: Final = 3.0

_GAINS: Final = ((PITCH_GAIN.name, ROLL_GAIN.name), (THRUST_GAIN.name,), (YAW_RATE_GAIN.name,))
_ESSENTIAL: Final = frozenset(parameter.name for parameter in (PITCH_GAIN, ROLL_GAIN, THRUST_GAIN, FREQUENCY))
# Largest relative deviations of a usable excitation: it shows more than was known before.
_CERTAIN: Final = {
    parameter.name: 0.5 * parameter.spread
    for parameter in (PITCH_GAIN, ROLL_GAIN, THRUST_GAIN, FREQUENCY, YAW_RATE_GAIN)
}

Flights = Sequence[FlightRecording]
MotionOf = Callable[[Candidate, FlightRecording], Motion]


def identify(
    recording: FlightRecording, model: Model, *more: FlightRecording, ordinary: bool = False
) -> Identification:
    """Fit a model to a flight of at least `SHORTEST_S` with all sticks excited, or to several together.

    Of an `ordinary` flight, which no person supervises, no gain beyond the uncertainty of the model is
    accepted: a vehicle that differs by more has a fault, or is of another type.

    Raises ValueError for less, a part shorter than `SHORTEST_PART_S`, or a flight of another type of vehicle.
    """
    flights = (recording, *more)
    _check(flights, model.kind)
    fitted = [flight.part(0.0, FITTED_SHARE) for flight in flights]
    hover = _hover_thrust(flights, model)
    logged = any(flight.logged for flight in flights)
    known = replace(model, gravity_m_s2=hover * model.input_gain[U_THRUST]) if logged else model
    with_tilt = all(flight.tilt is not None for flight in flights)
    judged = [flight.part(FITTED_SHARE - SETTLE_S / flight.duration_s, 1.0) for flight in flights]
    candidate, parts = Candidate(known), []
    fits = (
        _horizontal_fit(candidate, with_tilt, logged),
        _Fit(vertical_parameters(logged), vertical, logged),
        _Fit(heading_parameters(model), heading, far=True),
    )
    for name, fit in zip(PARTS, fits, strict=True):
        found = fit.run(candidate, fitted)
        if name == HORIZONTAL and with_tilt and not logged:
            found = _perhaps_with_lever(found, candidate, fitted)
        part = _judged(name, found, Candidate(known), model, judged)
        parts.append(_within(part, model) if ordinary else part)
        candidate = found.candidate if parts[-1].accepted else candidate
    height = parts[PARTS.index(HEIGHT)]
    finished = _finished(candidate.model, model, hover if height.accepted else None)
    return Identification(
        replace(finished, uncertainty=_uncertainty(finished, model, parts)), candidate.offsets, tuple(parts)
    )


def _judged(name: str, found: "_Found", start: Candidate, model: Model, flights: Flights) -> FittedPart:
    """Judge the fit of a part, which began at `start`, by flights that were not fitted."""
    numbers, bounds = found.numbers(start), found.at_bounds()
    in_same_air = replace(model, gust_density=found.candidate.model.gust_density)
    before = _error(Candidate(in_same_air, found.candidate.offsets), found.motion, flights)
    after = _error(found.candidate, found.motion, flights)
    essential = [
        f"{at_bound} went as far as it may: the vehicle is not of this type, or the flight does not show it"
        for at_bound in bounds
        if at_bound in _ESSENTIAL
    ]
    problems = (*_too_little(numbers), *_worse(name, before, after), *essential)
    remarks = tuple(_doubtful(at_bound, name) for at_bound in bounds if at_bound not in _ESSENTIAL)
    return FittedPart(name, tuple(numbers), before, after, problems, remarks)


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


def _error(candidate: Candidate, motion_of: MotionOf, flights: Flights) -> float:
    """Error of predictions one second ahead in some flights, rms per axis."""
    motions = [motion_of(candidate, flight) for flight in flights]
    errors = np.concatenate(
        [each.errors_ahead(round(AHEAD_S / each.period_s))[each.settled :] for each in motions]
    )
    return float(np.sqrt(np.mean(np.abs(errors) ** 2) / (2.0 if motion_of is horizontal else 1.0)))


def errors_ahead(model: Model, flight: FlightRecording) -> dict[str, float]:
    """Return the errors of a model's predictions one second ahead by part, as of `FittedPart`."""
    motions = zip(PARTS, (horizontal, vertical, heading), strict=True)
    return {part: _error(Candidate(model), motion, [flight]) for part, motion in motions}


def predicted_ahead(candidate: Candidate, recording: FlightRecording) -> Array:
    """Return poses predicted one second ahead, shape (K, 4): x, y, z [m], yaw [rad]; NaN at first."""
    periods = round(AHEAD_S / recording.period_s)
    measured = np.column_stack((recording.position_m, recording.yaw_rad))[periods:]
    plane = horizontal(candidate, recording).errors_ahead(periods)
    others = [motion(candidate, recording).errors_ahead(periods).real for motion in (vertical, heading)]
    errors = np.column_stack((plane.real, plane.imag, *others))
    return np.vstack((np.full((periods, 4), np.nan), measured - errors))


@dataclass(frozen=True)
class _Found:
    candidate: Candidate
    motion: MotionOf
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
            # Gusts and weights follow from the errors of the best model so far.
            if self.motion is horizontal and not self.far:
                density = _likeliest_gusts(self._at(start, position), flights)
                start = replace(start, model=replace(start.model, gust_density=density))
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
        deviation = np.sqrt(np.diag(np.linalg.inv(solved.jac.T @ solved.jac)))
        return _Found(self._at(start, position), self.motion, self.parameters, position, deviation)

    def _at(self, start: Candidate, position: Array) -> Candidate:
        candidate = start
        for parameter, moved in zip(self.parameters, position, strict=True):
            value, shift = parameter.read(start), parameter.spread * float(moved)
            moved_to = value * math.exp(shift) if parameter.positive else value + shift
            candidate = parameter.write(candidate, moved_to)
        return candidate

    def _errors(self, candidate: Candidate, flights: Flights) -> list[Array]:
        motions = [self.motion(candidate, flight) for flight in flights]
        errors = [
            each.far_errors() if self.far else list(each.innovations()[each.settled :].T) for each in motions
        ]
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


def _likeliest_gusts(candidate: Candidate, flights: Flights) -> float:
    """The density of `_GUSTS` that makes the innovations of a candidate likeliest."""

    def improbability(density: float) -> float:
        return _improbability(
            replace(candidate, model=replace(candidate.model, gust_density=density)), flights
        )

    return min(_GUSTS, key=improbability)


def _improbability(candidate: Candidate, flights: Flights) -> float:
    """Sum over flights of the mean negative log likelihood of horizontal innovations."""
    return sum(horizontal(candidate, flight).improbability() for flight in flights)


def _perhaps_with_lever(plain: _Found, start: Candidate, flights: Flights) -> _Found:
    """Fit the lever arm, too; return that fit only if it is clearly likelier, as it loosens gains."""
    found = _horizontal_fit(start, with_tilt=True, logged=False, with_lever=True).run(start, flights)
    gain = _improbability(plain.candidate, flights) - _improbability(found.candidate, flights)
    return found if gain > _LIKELIER * len(flights) else plain


def _horizontal_fit(start: Candidate, with_tilt: bool, logged: bool, with_lever: bool = False) -> _Fit:
    parameters = horizontal_parameters(start.model, with_tilt, with_lever)
    begin_at: list[Array] = []
    if FREQUENCY in parameters:
        place = np.array([parameter is FREQUENCY for parameter in parameters], dtype=float)
        begin_at = [spreads * place for spreads in _START_FREQUENCIES]
    return _Fit(parameters, horizontal, logged, begin_at)


def _finished(model: Model, before: Model, hover: float | None) -> Model:
    """Fitted model with derived values: equivalent lags, and a hover thrust where the height is fitted."""
    lag_s = model.lag_s
    if model.tilt is not None and before.tilt is not None:
        slower = before.tilt.frequency_rad_s / model.tilt.frequency_rad_s
        lag_s = (lag_s[0] * slower, lag_s[1] * slower, *lag_s[2:])
    if hover is None:
        return replace(model, lag_s=lag_s, gravity_m_s2=before.gravity_m_s2)
    return replace(model, lag_s=lag_s, hover_thrust=hover)


def _uncertainty(model: Model, before: Model, parts: Sequence[FittedPart]) -> Uncertainty:
    """Uncertainty of a fitted model; parts that were refused stay as uncertain as before."""
    # Of a part in doubt only gain and delay do: no weights bear the frequencies and dampings of all vehicles
    # of a type with the model of one.
    certain = [
        {number.name: number.deviation / number.value for number in part.parameters if number.value > 0.0}
        for part in parts
    ]
    known, gains, delays_s = before.uncertainty, list[float](), list[float]()
    fractions = list(known.frequency_fraction)
    for axis, (part, names) in enumerate(zip(parts, _GAINS, strict=True)):
        fitted = 1.0 + _THREE_DEVIATIONS * max(certain[axis].get(name, 0.0) for name in names)
        # Gains that are kept are known; with prior knowledge of the type no gain is less certain than its.
        gain = max(IDENTIFIED.gain_factor[axis], min(fitted, known.gain_factor[axis]))
        delay_s = IDENTIFIED.delay_s[axis]
        if part.accepted:
            fractions[axis] = IDENTIFIED.frequency_fraction[axis]
        if part.remarks or not part.accepted:
            gain, delay_s = max(gain, known.gain_factor[axis]), max(delay_s, known.delay_s[axis])
        gains.append(gain)
        delays_s.append(delay_s)
    damping, without_tilt = known.tilt_damping, known.without_tilt
    if parts[0].accepted:
        fractions[0] = max(fractions[0], _THREE_DEVIATIONS * certain[0].get(FREQUENCY.name, 0.0))
        damping = _damping_range(model, before, certain[0].get(DAMPING.name, 0.0))
        without_tilt = None if model.tilt is None else (gains[0], delays_s[0], fractions[0])
    return Uncertainty(
        three(np.array(gains)), three(np.array(delays_s)), three(np.array(fractions)), damping, without_tilt
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


def _within(part: FittedPart, model: Model) -> FittedPart:
    """The part, with a problem for each gain that the uncertainty of the model does not contain."""
    axis = PARTS.index(part.name)
    factor = model.uncertainty.gain_factor[axis]
    beyond = tuple(
        f"{one.name} is {one.value / one.before:.2f} times that of the type: at most {factor:g} is learned"
        for one in part.parameters
        if one.name in _GAINS[axis] and not 1.0 / factor <= one.value / one.before <= factor
    )
    return replace(part, problems=part.problems + beyond)


def _too_little(numbers: Sequence[FittedParameter]) -> list[str]:
    return [
        f"too little excitation: {number.name} is known to within "
        f"{100 * number.deviation / number.value:.0f} % only, at most "
        f"{100 * _CERTAIN[number.name]:.0f} % is needed"
        for number in numbers
        if number.name in _CERTAIN and number.deviation > _CERTAIN[number.name] * abs(number.value)
    ]


def _worse(name: str, before: float, after: float) -> list[str]:
    if after <= WORSE * before:
        return []
    unit, old, new = "mrad" if name == HEADING else "mm", 1e3 * before, 1e3 * after
    return [
        f"fit worse than before: {name} one second ahead off by {new:.0f} {unit} instead of {old:.0f} {unit}"
    ]


def _doubtful(name: str, axis: str) -> str:
    return (
        f"{name} went as far as it may, so the gain of the {axis} counts as uncertain as before: the vehicle "
        "differs in something else, or sticks were at their ends; identify again with a lower --strength"
    )
