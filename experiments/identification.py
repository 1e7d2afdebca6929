"""Helicopters before and after their identification: hover, and predictions one second ahead."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, Final

import numpy as np

from agents.identification.excitation import excitation_for
from agents.identification.fit import Identification, identify
from agents.identification.recording import FlightRecording
from experiments.hover import AXES, SET_POINT_M
from experiments.rig import Rig, RigVehicle
from experiments.runner import Options, Result, Tell, Work, run_all
from simulator.conditions import PRESETS, Conditions
from simulator.plant import Pose
from vehicles.model import Model
from vehicles.state import YAW, Array
from vehicles.types import COAXIAL

EXCITED_S: Final = 70.0
SETTLING_S: Final = 6.0
REACH_M: Final = 0.4
HOVER_S: Final = 40.0
QUICK_HOVER_S: Final = 12.0
SETTLED_S: Final = 8.0
FIRST_ORDER_PRESET: Final = "laboratory"
"""Preset of the experiments that knows no helicopters."""


@dataclass(frozen=True)
class Case:
    """How a vehicle is identified and flown.

    Attributes
    ----------
    name, title
        For documents and figures.
    estimator_settings
        With or without the measured tilt.
    """

    name: str
    title: str
    estimator_settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def with_tilt(self) -> bool:
        """Whether the tilt is measured."""
        return bool(self.estimator_settings.get("measured_tilt", True))


CASES: Final = (
    Case("tilt_measured", "tilt measured"),
    Case("positions_only", "positions only", {"measured_tilt": False}),
)


@dataclass(frozen=True)
class Outcome:
    """One vehicle: root mean squares of x, y, z [m] and yaw [rad] before and after, shape (4,)."""

    before: Array
    after: Array
    found: Identification


def same_delay(conditions: Conditions, model: Model) -> Conditions:
    """Conditions in which the plant's delay is that of a model, whatever a controller believes."""
    delay_s = model.delay_s if conditions.transport_delay_s is None else conditions.transport_delay_s
    return replace(conditions, transport_delay_s=delay_s)


def excited_flight(model: Model, conditions: Conditions, seed: int, case: Case) -> FlightRecording:
    """Hover a vehicle and excite its sticks.

    Returns
    -------
    FlightRecording
        The excited part.
    """
    rig = Rig([_vehicle(model, case)], same_delay(conditions, model), seed)
    rig.fly(SETTLING_S)
    pilot, log = rig.pilots["h1"], rig.log("h1")
    pilot.exciter.begin(excitation_for(model, EXCITED_S), np.array(SET_POINT_M), REACH_M, pilot.clock.time_s)
    rig.fly(EXCITED_S)
    recording = log.recording()
    return recording if case.with_tilt else recording.without_tilt()


def hover_errors(
    model: Model, conditions: Conditions, seed: int, case: Case, duration_s: float = HOVER_S
) -> Array:
    """Root mean squares of x, y, z [m] and yaw [rad] of a settled hover, shape (4,)."""
    rig = Rig([_vehicle(model, case)], conditions, seed)
    flown = rig.fly(duration_s)["h1"]
    errors = (flown.motion[:, : YAW + 1] - flown.reference)[flown.time_s >= min(SETTLED_S, 0.5 * duration_s)]
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=0)))


def fly_case(case: Case, conditions: Conditions, seed: int, hover_s: float) -> Outcome:
    """Hover, identify, hover again."""
    fixed = same_delay(conditions, COAXIAL)
    before = hover_errors(COAXIAL, fixed, seed, case, hover_s)
    found = identify(excited_flight(COAXIAL, fixed, seed, case), COAXIAL)
    return Outcome(before, hover_errors(found.model, fixed, seed, case, hover_s), found)


def run(options: Options, tell: Tell) -> Result:
    """Identify a vehicle of every seed, with and without measured tilt.

    Returns
    -------
    Result
        Document: case -> vehicles and their median and worst horizontal axis.
    """
    preset = "helicopters" if options.preset == FIRST_ORDER_PRESET else options.preset
    hover_s = QUICK_HOVER_S if options.quick else HOVER_S
    flights = [(case, seed) for case in CASES for seed in options.seeds]
    works = [
        Work(f"{case.title}, seed {seed}", partial(fly_case, case, PRESETS[preset], seed, hover_s))
        for case, seed in flights
    ]
    outcomes = run_all(works, options.processes, tell)
    document: dict[str, Any] = {}
    for case in CASES:
        own = {
            seed: outcome for (other, seed), outcome in zip(flights, outcomes, strict=True) if other is case
        }
        document[case.name] = _figures(own)
    return Result(document, partial(draw, document, preset))


def _figures(outcomes: Mapping[int, Outcome]) -> dict[str, Any]:
    worse = {
        when: np.array([1e3 * getattr(outcome, when)[:2].max() for outcome in outcomes.values()])
        for when in ("before", "after")
    }
    return {
        "horizontal_mm": {
            when: {"median": round(float(np.median(of)), 2), "worst": round(float(of.max()), 2)}
            for when, of in worse.items()
        },
        "vehicles": {str(seed): _vehicle_figures(outcome) for seed, outcome in outcomes.items()},
    }


def _vehicle_figures(outcome: Outcome) -> dict[str, Any]:
    def rms(errors: Array) -> dict[str, float]:
        lengths = {f"{axis}_mm": round(1e3 * float(errors[at]), 2) for at, axis in enumerate(AXES)}
        return {**lengths, "yaw_mrad": round(1e3 * float(errors[YAW]), 1)}

    return {
        "before": rms(outcome.before),
        "after": rms(outcome.after),
        "one_second_ahead": {"before": asdict(outcome.found.before), "after": asdict(outcome.found.after)},
        "parameters": {number.name: round(number.value, 5) for number in outcome.found.parameters},
        "problems": list(outcome.found.problems),
    }


def draw(document: Mapping[str, Any], preset: str, figure: Any) -> None:
    """Draw the worse horizontal axis of every vehicle before and after.

    Parameters
    ----------
    document
        As `run` returns it.
    preset
        Name of the conditions.
    figure
        Empty `matplotlib.figure.Figure`.
    """
    figure.set_size_inches(9, 4)
    for axes, case in zip(figure.subplots(1, len(CASES), sharey=True), CASES, strict=True):
        vehicles = document[case.name]["vehicles"]
        places = np.arange(len(vehicles))
        for shift, when, label in ((-0.2, "before", "as of its type"), (0.2, "after", "identified")):
            errors = [max(row[when]["x_mm"], row[when]["y_mm"]) for row in vehicles.values()]
            axes.bar(places + shift, errors, 0.4, label=label)
        axes.set_xticks(places, list(vehicles))
        axes.set_xlabel("seed")
        axes.set_title(case.title)
        axes.grid(axis="y", alpha=0.3)
        axes.legend(fontsize="small")
    figure.axes[0].set_ylabel("hover, worse axis, rms [mm]")
    figure.suptitle(f"Helicopters before and after identification, conditions `{preset}`")
    figure.tight_layout()


def _vehicle(model: Model, case: Case) -> RigVehicle:
    return RigVehicle("h1", model, Pose(SET_POINT_M), "cascade", estimator_settings=case.estimator_settings)
