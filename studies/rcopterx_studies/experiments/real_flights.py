"""Flights that others recorded of a Crazyflie, as evidence: estimators on their poses, predictions of them.

A model is fitted to every second flight and predicts the others, with the commands that were sent; then the
halves change places, so that no flight is predicted by a model that was fitted to it. Of any other vehicle a
part of one flight is fitted and the rest is predicted.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.signal import savgol_filter

from rcopterx.control.identification.fit import identify
from rcopterx.control.identification.motions import SETTLE_S
from rcopterx.control.identification.recording import FlightRecording, RecordingError
from rcopterx.control.identification.result import Identification
from rcopterx.control.interfaces import Estimate, EstimatesUncertainty, Measurement
from rcopterx.control.models.prediction import predict
from rcopterx.control.plugins import ESTIMATORS
from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, YAW, Array, inertial_velocity
from rcopterx_studies.experiments.flight_csv import is_csv, read_flight
from rcopterx_studies.experiments.knowledge import CRAZYFLIE
from rcopterx_studies.experiments.record import rms
from rcopterx_studies.figures import finish_figure

FIRMWARE_THRUST: Final = 65535.0
"""Full stick here: the firmware's position control asks for more than a radio may, `FULL_THRUST`."""
FEWEST: Final = 4
AHEAD_S: Final = (0.1, 0.25, 0.5, 1.0)
ESTIMATOR_NAMES: Final = ("extended_kalman", "finite_difference", "kalman")
EVERY_S: Final = 0.1
SMOOTHED_S: Final = 0.3
CONSTANT, TYPE, HOVERING, FITTED = "constant velocity", "type", "type, hover thrust set", "fitted"

Errors = Mapping[float, Array]  # predicted less real positions by the time ahead, shape (n, 3)


@dataclass(frozen=True)
class Followed:
    """An estimator on the poses of one or more flights: innovations, and over their expected deviations."""

    innovations_m: Array
    normalised: Array
    errors_m: Errors


def follow(
    flights: Iterable[tuple[FlightRecording, Model]], estimator_name: str, constant: bool = False
) -> Followed:
    """Run an estimator through flights, each with a model; predict by that or at a constant velocity."""
    innovations, normalised = list[Array](), list[Array]()
    errors: dict[float, list[Array]] = {ahead_s: [] for ahead_s in AHEAD_S}
    noise_m = getattr(ESTIMATORS.load(estimator_name).Settings(), "position_noise_m", 0.0)
    for flight, model in flights:
        period_s, settled = flight.period_s, round(SETTLE_S / flight.period_s)
        estimator = ESTIMATORS.build(estimator_name, model, period_s, {})
        time_s = period_s * np.arange(len(flight.yaw_rad))
        acts_s = time_s + 0.5 * period_s - model.delay_s
        acting = np.column_stack([np.interp(acts_s, time_s, stick) for stick in flight.inputs.T])
        for row, place_m in enumerate(flight.position_m):
            if row:
                estimator.predict(acting[row - 1], period_s)
            if row >= settled:
                innovations.append(place_m - estimator.estimate.motion[:YAW])
                if isinstance(estimator, EstimatesUncertainty):
                    normalised.append(innovations[-1] / np.hypot(estimator.position_deviation_m(), noise_m))
            tilt = None if flight.tilt is None else flight.tilt[row]
            estimator.correct(Measurement(place_m, float(flight.yaw_rad[row]), tilt))
            if row >= settled and row % round(EVERY_S / period_s) == 0:
                sticks = acting[:-1][row : row + round(AHEAD_S[-1] / period_s)]
                places = _places(None if constant else model, estimator.estimate, sticks, period_s)
                for ahead_s in AHEAD_S:
                    if (coming := round(ahead_s / period_s)) < len(places):
                        errors[ahead_s].append(places[coming] - flight.position_m[row + coming])
    found = {ahead_s: np.array(rows) for ahead_s, rows in errors.items()}
    return Followed(np.array(innovations), np.array(normalised), found)


def _places(model: Model | None, estimate: Estimate, sticks: Array, period_s: float) -> list[Array]:
    """Positions now and after each of some sticks, at a constant velocity without a model."""
    places = [estimate.motion[:YAW]]
    velocity_m_s = inertial_velocity(estimate.motion)
    for stick in sticks:
        if model is None:
            places.append(places[-1] + period_s * velocity_m_s)
        else:
            estimate = predict(model, estimate, stick, period_s)
            places.append(estimate.motion[:YAW])
    return places


def read_flights(directory: Path) -> tuple[dict[str, FlightRecording], dict[str, str]]:
    """Read CSV files: flights, why others are unusable; `RecordingError`: fewer than `FEWEST` flights."""
    flights, unusable = {}, {}
    for path in sorted(filter(is_csv, directory.iterdir())):
        name = path.name.partition(".")[0]
        try:
            flights[name] = read_flight(path, CRAZYFLIE.kind, CrazyflieSettings(), FIRMWARE_THRUST)
        except RecordingError as error:
            unusable[name] = str(error)
    if len(flights) < FEWEST:
        reasons = "".join(f"\n{reason}" for reason in unusable.values())
        raise RecordingError(f"{directory}: {len(flights)} flights, at least {FEWEST} are needed{reasons}")
    return flights, unusable


def type_model(hover: float | None = None) -> Model:
    """Return the type `crazyflie` for the firmware's thrust, perhaps with the one that it hovers with."""
    pitch, roll, thrust, yaw = CRAZYFLIE.input_gain
    more = FIRMWARE_THRUST / FULL_THRUST
    gain = thrust * more if hover is None else GRAVITY_M_S2 / hover
    return replace(CRAZYFLIE, input_gain=(pitch, roll, gain, yaw), hover_thrust=GRAVITY_M_S2 / gain)


@dataclass(frozen=True)
class Evidence:
    """What flights show: fits to two halves, estimators, and predictions by model."""

    fits: tuple[Identification, ...]
    estimators: Mapping[str, Followed]
    models: Mapping[str, Followed]
    draught_m_s2: Array

    def document(self) -> dict[str, Any]:
        """Return the figures as a JSON document."""
        prediction = {
            name: {f"{ahead_s:g} s": _sizes_mm(errors) for ahead_s, errors in runs.errors_m.items()}
            for name, runs in self.models.items()
        }
        return {
            "prediction_rms": prediction,
            "innovations": {name: _innovations(runs) for name, runs in self.estimators.items()},
            "draught_m_s2": self.draught_m_s2.round(3).tolist(),
            "fits": [_fit_document(fit) for fit in self.fits],
        }

    def draw(self, figure: Any) -> None:
        """Draw errors of predictions by time ahead, horizontal and in height."""
        figure.set_size_inches(9, 4)
        for axes, part in zip(figure.subplots(1, 2, sharey=True), ("horizontal", "height"), strict=True):
            for name, runs in self.models.items():
                sizes_mm = [_sizes_mm(errors)[f"{part}_mm"] for errors in runs.errors_m.values()]
                axes.loglog(AHEAD_S, sizes_mm, "o-", label=name)
            axes.set(xlabel="time ahead [s]", ylabel=f"{part}, rms of the distance [mm]")
        figure.axes[0].legend(fontsize="small")
        finish_figure(figure, "Predictions of real flights that the model was not fitted to")


def judge(flights: Sequence[FlightRecording]) -> Evidence:
    """Fit models to the halves, and follow every flight with all estimators and models."""
    halves = flights[::2], flights[1::2]
    fits = tuple(identify(half[0], type_model(), *half[1:]) for half in halves)
    fitted = [(flight, fits[1 - number % 2].model) for number, flight in enumerate(flights)]
    estimators = {name: follow(fitted, name, constant=True) for name in ESTIMATOR_NAMES}
    known = {
        TYPE: [(flight, type_model()) for flight in flights],
        HOVERING: [(flight, type_model(model.hover_thrust)) for flight, model in fitted],
        FITTED: fitted,
    }
    models = {name: follow(pairs, "extended_kalman") for name, pairs in known.items()}
    draught_m_s2 = np.sqrt(np.mean([draught(flight) for flight in flights], axis=0))
    return Evidence(fits, estimators, {CONSTANT: estimators["kalman"], **models}, draught_m_s2)


SHARES: Final = ((0.0, 0.6), (0.2, 0.8), (0.4, 1.0))
"""Parts of a single flight that a model is fitted to; it predicts the others."""


def predict_rest(flight: FlightRecording, known: Model) -> dict[str, Any]:
    """Fit a type to parts of a flight, predict the rest, and compare with predictions at a constant velocity.

    Returns a JSON document: by part the fit, and ratios of errors by model and time ahead, horizontal and in
    height.
    """
    document = {}
    for begin, end in SHARES:
        fit = identify(flight.part(begin, end), known)
        rest = [flight.part(*part) for part in ((0.0, begin), (end, 1.0)) if part[0] < part[1]]
        straight = follow([(one, known) for one in rest], "kalman", constant=True)
        document[f"{begin:g} to {end:g}"] = _fit_document(fit) | {
            name: {
                f"{ahead_s:g} s": _ratios(_sizes_mm(errors), _sizes_mm(straight.errors_m[ahead_s]))
                for ahead_s, errors in follow(
                    [(one, model) for one in rest], "extended_kalman"
                ).errors_m.items()
            }
            for name, model in ((TYPE, known), (FITTED, fit.model))
        }
    return document


def _ratios(sizes: Mapping[str, float], of_straight: Mapping[str, float]) -> dict[str, float]:
    return {name.removesuffix("_mm"): round(size / of_straight[name], 2) for name, size in sizes.items()}


def _fit_document(fit: Identification) -> dict[str, Any]:
    parameters = {one.name: float(f"{one.value:.3g}") for one in fit.parameters}
    return {"parameters": parameters, "problems": list(fit.problems)}


def draught(flight: FlightRecording) -> Array:
    """Return the mean square of the acceleration along x and y that tilt and drag do not explain, shape (2,).

    Regression over the flight; accelerations are smoothed over `SMOOTHED_S`.
    """
    assert flight.tilt is not None
    rows = 2 * round(SMOOTHED_S / flight.period_s / 2) + 1
    place, tilt = flight.position_m[:, :2], savgol_filter(flight.tilt, rows, 3, axis=0)
    velocity, acceleration = (
        savgol_filter(place, rows, 3, deriv, flight.period_s, axis=0)[rows:-rows] for deriv in (1, 2)
    )
    found = []
    for axis in range(2):
        causes = np.column_stack((tilt[rows:-rows, axis], velocity[:, axis], np.ones(len(velocity))))
        fitted = causes @ np.linalg.lstsq(causes, acceleration[:, axis], rcond=None)[0]
        found.append(rms(acceleration[:, axis] - fitted) ** 2)
    return np.array(found)


def _sizes_mm(errors_m: Array) -> dict[str, float]:
    parts = {"horizontal_mm": errors_m[:, :2], "height_mm": errors_m[:, 2:], "distance_mm": errors_m}
    return {name: round(1e3 * rms(np.linalg.norm(part, axis=1)), 1) for name, part in parts.items()}


def _innovations(runs: Followed) -> dict[str, Any]:
    """Size, mean square over the expected one (1 if consistent), correlation with the one before (0)."""
    now, before = runs.innovations_m[1:], runs.innovations_m[:-1]
    return {
        "rms_mm": [round(1e3 * rms(axis), 2) for axis in now.T],
        "normalised_squared": [round(rms(axis) ** 2, 2) for axis in runs.normalised.T],
        "autocorrelation": [
            round(float(np.sum(a * b) / np.sum(a * a)), 2) for a, b in zip(now.T, before.T, strict=True)
        ],
    }
