"""Vehicles drawn from a family, each flown through hover, steps, yaw steps and a figure-eight.

What a laboratory may expect of an untuned vehicle: a distribution over many vehicles, at several levels of
knowledge of the vehicle, with the tilt measured and without.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import product
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from rcopterx.control.references.path_shapes import figure_eight
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import INPUT_SIZE, YAW, Array
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.experiments.events import FlyEvent, GoToEvent, PilotEvent
from rcopterx_studies.experiments.knowledge import LEARNED_LEVELS, Knowledge, learn_around
from rcopterx_studies.experiments.record import VehicleRecord, rms
from rcopterx_studies.experiments.rig import GUARDED, Progress, Rig
from rcopterx_studies.experiments.runner import Cases, Experiment, FlightResult, Options
from rcopterx_studies.experiments.schemes import CASCADE, FlownScheme
from rcopterx_studies.figures import finish_figure

HOME_M: Final[Three] = (0.0, 0.0, 1.0)
LOST_M: Final = 0.5  # further from its last set point at the end of the flight, a vehicle is lost
LIMIT_CYCLE_STICK: Final = 0.4
"""Standard deviation of a stick from which its motion counts as a limit cycle; a sine from stop to stop has
0.7."""
LIMIT_CYCLE_MRAD: Final = 100.0
"""Root mean square error of the heading in hover from which it counts as one; turbulence causes 25 to 50."""

TARGETS_MM: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "default / tilt measured": (9.0, 16.0),
        "default / positions only": (25.0, 50.0),
        "identified / tilt measured": (9.0, 16.0),
        "identified / positions only": (14.0, 28.0),
        "exact / tilt measured": (9.0, 16.0),
        "exact / positions only": (11.0, 20.0),
    }
)
"""Targets of hover of helicopters by level: median and worst vehicle."""
PANELS: Final = MappingProxyType(
    {
        "hover_mm": "hover: rms error of the worse horizontal axis [mm]",
        "eight_mm": "figure-eight: rms distance from the path's present point [mm]",
    }
)


@dataclass(frozen=True)
class Programme:
    """Times of the parts of a flight.

    Hover counts from `settled_s` to `hover_s`. Each set point takes `slot_s`, with rest in the last `rest_s`.
    """

    settled_s: float = 5.0
    hover_s: float = 20.0
    slot_s: float = 5.0
    rest_s: float = 1.5


PROGRAMME: Final = Programme()
QUICK_PROGRAMME: Final = Programme(settled_s=3.0, hover_s=6.0, slot_s=3.0, rest_s=0.5)
STEPS: Final[tuple[tuple[Three, float], ...]] = (((0.4, 0.3, 1.3), 0.0), (HOME_M, 0.0))
YAW_STEPS: Final[tuple[tuple[Three, float], ...]] = ((HOME_M, np.pi / 2), (HOME_M, 0.0))
EIGHT: Final = figure_eight(HOME_M, (0.5, 0.25), 6.0)
CLIMB_M: Final[Three] = (0.6, 0.0, 1.8)
THERE_M: Final = 0.05  # a vehicle has arrived after which it stays within this distance of a set point


def levels_of(knowledge: Sequence[Knowledge]) -> dict[str, FlownScheme]:
    """The default configuration at every level of knowledge, with the tilt measured and without."""
    return {
        f"{known} / {'tilt measured' if tilt else 'positions only'}": replace(
            CASCADE, estimator_settings={"measured_tilt": tilt}, knowledge=known
        )
        for known, tilt in product(knowledge, (True, False))
    }


@dataclass(frozen=True)
class FlownFamily:
    """Figures of one vehicle.

    In hover the root mean square errors of the worse horizontal axis, of height and of yaw, and that of the
    worse of pitch and roll stick, trim included. `climb_s` is the time after which the vehicle stays near the
    end of a step with a climb. `stick_deviation` is the largest standard deviation of these
    sticks in hover or at rest after a step, `rest_mm` the largest distance from the set point at rest,
    `yaw_step_mm` the largest horizontal one during yaw steps. A vehicle is `lost` that left the volume or did
    not arrive at its last set point.
    """

    hover_mm: float
    height_mm: float
    yaw_mrad: float
    stick: float
    stick_deviation: float
    rest_mm: float
    yaw_step_mm: float
    eight_mm: float
    eight_max_mm: float
    climb_s: float
    lost: bool
    touched_floor: bool
    fallbacks: int

    @property
    def limit_cycle(self) -> bool:
        """Whether a stick swings between its limits, or the heading to and fro, in hover or at rest."""
        return self.stick_deviation > LIMIT_CYCLE_STICK or self.yaw_mrad > LIMIT_CYCLE_MRAD


DISTRIBUTED: Final = tuple(field.name for field in fields(FlownFamily) if field.type in (float, "float"))
"""Figures that are reported as a distribution."""


def fly_member(
    scheme: FlownScheme,
    programme: Programme,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> FlownFamily:
    """Fly one vehicle through the whole programme."""
    slots = STEPS + YAW_STEPS
    vehicle = scheme.vehicle("h1", BodyPose(HOME_M), conditions, seed)
    rig = Rig([vehicle], conditions, seed, GUARDED)
    if scheme.knowledge == "learned":
        learn_around(rig, HOME_M, seed)
    hovered_s = rig.time_s + programme.hover_s
    starts = [hovered_s + index * programme.slot_s for index in range(len(slots) + 1)]
    events: list[PilotEvent] = [
        GoToEvent(at_s, "h1", place, yaw_rad) for at_s, (place, yaw_rad) in zip(starts, slots, strict=False)
    ]
    flown_s = starts[-1] + EIGHT.duration_s
    climbs_s = flown_s + programme.rest_s
    events += [FlyEvent(starts[-1], "h1", EIGHT), GoToEvent(climbs_s, "h1", CLIMB_M, 0.0)]
    record = rig.fly(climbs_s + programme.slot_s - rig.time_s, events, progress)["h1"]
    eight = (record.time_s >= starts[-1]) & (record.time_s < flown_s)
    wanted = EIGHT.sample(record.time_s[eight] - starts[-1])[:, :3]
    return _figures(record, programme, (*starts, climbs_s), record.motion[eight, :3] - wanted)


def _figures(
    record: VehicleRecord, programme: Programme, starts: Sequence[float], eight_error_m: Array
) -> FlownFamily:
    def between(first_s: float, last_s: float) -> Array:
        return np.asarray((record.time_s >= first_s) & (record.time_s < last_s))

    hover = between(starts[0] - programme.hover_s + programme.settled_s, starts[0])
    *_, eight_s, climbs_s = starts
    rests = [between(end_s - programme.rest_s, end_s) for end_s in starts[1:-1]]
    yaw_steps = between(starts[len(STEPS)], eight_s)
    errors = record.reference_error()
    hover_rms = np.sqrt(np.mean(np.square(errors[hover]), axis=0))
    sticks = record.inputs[:, : INPUT_SIZE - 2]
    distance_m = np.linalg.norm(errors[:, :3], axis=1)
    eight_m = np.linalg.norm(eight_error_m, axis=1)
    from_climb_m = np.linalg.norm(record.motion[:, :3] - CLIMB_M, axis=1)
    return FlownFamily(
        hover_mm=1e3 * float(hover_rms[:2].max()),
        height_mm=1e3 * float(hover_rms[2]),
        yaw_mrad=1e3 * float(hover_rms[YAW]),
        stick=float(np.sqrt(np.mean(np.square(sticks[hover]), axis=0)).max()),
        stick_deviation=max(float(sticks[rows].std(axis=0).max()) for rows in (hover, *rests)),
        rest_mm=1e3 * max(float(distance_m[rows].max()) for rows in rests),
        yaw_step_mm=1e3 * float(np.linalg.norm(errors[yaw_steps, :2], axis=1).max()),
        eight_mm=1e3 * rms(eight_m),
        eight_max_mm=1e3 * float(eight_m.max()),
        climb_s=float(record.time_s[from_climb_m > THERE_M].max()) - climbs_s,
        lost=record.left_volume or not float(from_climb_m[-1]) < LOST_M,
        touched_floor=record.touchdowns > 0,
        fallbacks=sum(record.fallbacks.values()),
    )


def cases(options: Options) -> Cases[FlownFamily]:
    """Every level."""
    programme = QUICK_PROGRAMME if options.quick else PROGRAMME
    levels = levels_of(options.knowledge)
    return {level: partial(fly_member, scheme, programme) for level, scheme in levels.items()}


def distribution(vehicles: Mapping[int, FlownFamily]) -> dict[str, Any]:
    """Median, 95 % and worst of every figure over vehicles by seed; seeds of those that failed."""
    table: dict[str, Any] = {}
    for name in DISTRIBUTED:
        values = {seed: getattr(flown, name) for seed, flown in vehicles.items()}
        median, most, worst = np.percentile(list(values.values()), (50, 95, 100)).round(3).tolist()
        worst_seed = max(values, key=lambda seed: values[seed])
        table[name] = {"median": median, "95%": most, "worst": worst, "worst_seed": worst_seed}
    return table | {
        "vehicles": len(vehicles),
        "lost": [seed for seed, one in vehicles.items() if one.lost],
        "touched_floor": [seed for seed, one in vehicles.items() if one.touched_floor],
        "limit_cycles": [seed for seed, one in vehicles.items() if one.limit_cycle],
        "fallbacks": sum(one.fallbacks for one in vehicles.values()),
    }


def draw_family(result: FlightResult[FlownFamily], figure: Any) -> None:
    """Draw cumulative distributions over the vehicles, and the targets of hover."""
    figure.set_size_inches(11, 4.5)
    for axes, (name, label) in zip(figure.subplots(1, len(PANELS), sharey=True), PANELS.items(), strict=True):
        for index, (level, flown) in enumerate(result.flown.items()):
            colour, title = f"C{index}", f"{level.replace(' / ', ', ')} ({len(flown)})"
            ordered = np.sort([getattr(one, name) for one in flown.values()])
            share = np.arange(1, len(ordered) + 1) / len(ordered)
            axes.step(ordered, share, where="post", color=colour, label=title)
            if name == "hover_mm" and level in TARGETS_MM and result.options.preset == "helicopters":
                axes.plot(TARGETS_MM[level], (0.5, 1.0), "o", color=colour, fillstyle="none", clip_on=False)
        axes.set(xlabel=label, xlim=(0.0, None))
    figure.axes[0].set_ylabel("part of the vehicles")
    figure.axes[0].legend(fontsize="small", loc="lower right", title="circles: targets of median and worst")
    finish_figure(figure, f"Vehicles drawn from the family, conditions `{result.options.preset}`")


EXPERIMENT: Final = Experiment(
    "family",
    "Fifty drawn vehicles, twenty like a real one, hover, step, turn and fly an eight",
    {"helicopters": 50, "coaxes": 20},
    cases,
    lambda _, flights: distribution(flights),
    draw_family,
    levels=LEARNED_LEVELS,
)
