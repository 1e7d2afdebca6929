"""Helicopters drawn from the family, each flown through hover, steps, yaw steps and a figure-eight.

What a laboratory may expect of an untuned vehicle: a distribution over many vehicles, at several levels of
knowledge of the vehicle, with the tilt measured and without.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from itertools import product
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from rcopterx.control.references.path_shapes import figure_eight
from rcopterx.experiments.events import Event, Fly, GoTo
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.knowledge import Knowledge
from rcopterx.experiments.record import VehicleRecord, rms
from rcopterx.experiments.rig import GUARDED, Progress, Rig, RigOptions
from rcopterx.experiments.runner import Options, Result, ShowProgress, fly_seeds
from rcopterx.experiments.schemes import CASCADE, Scheme
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import Particulars
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, YAW, Array
from rcopterx.vehicles.tuples import Three

HOME_M: Final[Three] = (0.0, 0.0, 1.0)
LOST_M: Final = 0.5
"""Further from home at the end of the flight, a vehicle is lost."""
LIMIT_CYCLE_STICK: Final = 0.4
"""Standard deviation of a stick from which its motion counts as a limit cycle; a sine from stop to stop has
0.7."""
LIMIT_CYCLE_MRAD: Final = 100.0
"""Root mean square error of the heading in hover from which it counts as one; turbulence causes 25 to 50."""
QUICK_VEHICLES: Final = 2

LevelName = tuple[str, str]
"""Knowledge of the pilot, and what the Tracker measures."""

TARGETS_MM: Final[Mapping[LevelName, tuple[float, float]]] = MappingProxyType(
    {
        ("default", "tilt measured"): (22.0, 40.0),
        ("default", "positions only"): (25.0, 50.0),
        ("identified", "tilt measured"): (12.0, 22.0),
        ("identified", "positions only"): (14.0, 28.0),
        ("exact", "tilt measured"): (9.0, 16.0),
        ("exact", "positions only"): (11.0, 20.0),
    }
)
"""Targets of hover: median and worst vehicle."""
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
    A turn of the figure-eight takes `eight_s`.
    """

    settled_s: float = 5.0
    hover_s: float = 20.0
    slot_s: float = 5.0
    rest_s: float = 1.5
    eight_s: float = 6.0


PROGRAMME: Final = Programme()
QUICK_PROGRAMME: Final = Programme(settled_s=3.0, hover_s=6.0, slot_s=3.0, rest_s=0.5, eight_s=6.0)
STEPS: Final[tuple[tuple[Three, float], ...]] = (((0.4, 0.3, 1.3), 0.0), (HOME_M, 0.0))
YAW_STEPS: Final[tuple[tuple[Three, float], ...]] = ((HOME_M, np.pi / 2), (HOME_M, 0.0))
EIGHT: Final = partial(figure_eight, HOME_M, (0.5, 0.25))


@dataclass(frozen=True)
class Level:
    """What the pilot knows of its vehicle, and whether the Tracker measures the tilt."""

    knowledge: Knowledge
    tilt: bool

    @property
    def title(self) -> str:
        """Title for figures and labels."""
        return f"{self.knowledge}, {self.measured}"

    @property
    def measured(self) -> str:
        """The Tracker's part of the title."""
        return "tilt measured" if self.tilt else "positions only"

    @property
    def scheme(self) -> Scheme:
        """The default configuration at this level."""
        return Scheme(
            CASCADE.name,
            CASCADE.title,
            CASCADE.controller,
            estimator_settings={"measured_tilt": self.tilt},
            knowledge=self.knowledge,
        )


def levels_of(knowledge: Sequence[Knowledge]) -> tuple[Level, ...]:
    """Every level of knowledge with the tilt measured and without."""
    return tuple(Level(known, tilt) for known, tilt in product(knowledge, (True, False)))


@dataclass(frozen=True)
class Flown:
    """Figures of one vehicle.

    In hover the root mean square errors of the worse horizontal axis, of height and of yaw, and that of the
    worse of pitch and roll stick, trim included. `stick_deviation` is the largest standard deviation of these
    sticks in hover or at rest after a step, `rest_mm` the largest distance from the set point at rest,
    `yaw_step_mm` the largest horizontal one during yaw steps. A vehicle is `lost` that left the volume or did
    not return home.
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
    lost: bool
    touched_floor: bool
    fallbacks: int

    @property
    def limit_cycle(self) -> bool:
        """Whether a stick swings between its limits, or the heading to and fro, in hover or at rest."""
        return self.stick_deviation > LIMIT_CYCLE_STICK or self.yaw_mrad > LIMIT_CYCLE_MRAD


DISTRIBUTED: Final = tuple(field.name for field in fields(Flown) if field.type in (float, "float"))
"""Figures that are reported as a distribution."""


@dataclass(frozen=True)
class TrueVehicle:
    """What flies in place of what the conditions give, see `RigVehicle`."""

    particulars: Particulars | None = None
    plant_type: Model | None = None


def fly_member(
    scheme: Scheme,
    programme: Programme,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
    true: TrueVehicle | None = None,
    options: RigOptions = GUARDED,
) -> Flown:
    """Fly one vehicle through the whole programme."""
    slots = STEPS + YAW_STEPS
    starts = [programme.hover_s + index * programme.slot_s for index in range(len(slots) + 1)]
    path = EIGHT(programme.eight_s)
    events: list[Event] = [
        GoTo(at_s, "h1", place, yaw_rad) for at_s, (place, yaw_rad) in zip(starts, slots, strict=False)
    ]
    events.append(Fly(starts[-1], "h1", path))
    vehicle = scheme.vehicle("h1", Pose(HOME_M), conditions, seed)
    if true is not None:
        plant_type = true.plant_type or vehicle.plant_type
        vehicle = replace(vehicle, particulars=true.particulars, plant_type=plant_type)
    rig = Rig([vehicle], conditions, seed, options)
    record = rig.fly(starts[-1] + path.duration_s, events, progress)["h1"]
    eight = record.time_s >= starts[-1]
    wanted = path.sample(record.time_s[eight] - starts[-1])[:, :3]
    return _figures(record, programme, starts, record.motion[eight, :3] - wanted)


def _figures(
    record: VehicleRecord, programme: Programme, starts: Sequence[float], eight_error_m: Array
) -> Flown:
    def between(first_s: float, last_s: float) -> Array:
        return np.asarray((record.time_s >= first_s) & (record.time_s < last_s))

    hover = between(programme.settled_s, programme.hover_s)
    rests = [between(end_s - programme.rest_s, end_s) for end_s in starts[1:]]
    yaw_steps = between(starts[len(STEPS)], starts[-1])
    errors = record.reference_error()
    hover_rms = np.sqrt(np.mean(np.square(errors[hover]), axis=0))
    sticks = record.inputs[:, : INPUT_SIZE - 2]
    distance_m = np.linalg.norm(errors[:, :3], axis=1)
    eight_m = np.linalg.norm(eight_error_m, axis=1)
    end_m = float(np.linalg.norm(record.motion[-1, :3] - np.array(HOME_M)))
    return Flown(
        hover_mm=1e3 * float(hover_rms[:2].max()),
        height_mm=1e3 * float(hover_rms[2]),
        yaw_mrad=1e3 * float(hover_rms[YAW]),
        stick=float(np.sqrt(np.mean(np.square(sticks[hover]), axis=0)).max()),
        stick_deviation=max(float(sticks[rows].std(axis=0).max()) for rows in (hover, *rests)),
        rest_mm=1e3 * max(float(distance_m[rows].max()) for rows in rests),
        yaw_step_mm=1e3 * float(np.linalg.norm(errors[yaw_steps, :2], axis=1).max()),
        eight_mm=1e3 * rms(eight_m),
        eight_max_mm=1e3 * float(eight_m.max()),
        lost=record.left_volume or not end_m < LOST_M,
        touched_floor=record.touchdowns > 0,
        fallbacks=sum(record.fallbacks.values()),
    )


def run(options: Options, show: ShowProgress) -> Result:
    """Fly every vehicle at every level.

    Returns
    -------
    Result
        Document: knowledge -> what is measured -> figure -> median, 95 %, worst, and counts.
    """
    programme = QUICK_PROGRAMME if options.quick else PROGRAMME
    if options.quick:
        options = replace(options, seeds=options.seeds[:QUICK_VEHICLES])
    levels = {level.title: level for level in levels_of(options.knowledge)}
    flown = fly_seeds(
        {title: partial(fly_member, level.scheme, programme) for title, level in levels.items()},
        options,
        show,
    )
    document: dict[str, dict[str, Any]] = {}
    drawn: dict[tuple[str, str], dict[str, list[float]]] = {}
    for title, level in levels.items():
        vehicles = flown[title]
        document.setdefault(level.knowledge, {})[level.measured] = distribution(vehicles)
        drawn[level.knowledge, level.measured] = {
            figure: [getattr(one, figure) for one in vehicles.values()] for figure in ("hover_mm", "eight_mm")
        }
    return Result(document, partial(draw_family, drawn, options.preset))


def distribution(vehicles: Mapping[int, Flown]) -> dict[str, Any]:
    """Median, 95 % and worst of every figure over vehicles by seed; seeds of those that failed."""
    rows = {seed: asdict(flown) for seed, flown in vehicles.items()}
    table: dict[str, Any] = {}
    for name in DISTRIBUTED:
        values = {seed: float(row[name]) for seed, row in rows.items()}
        table[name] = {
            "median": _rounded(np.median(list(values.values()))),
            "95%": _rounded(np.percentile(list(values.values()), 95)),
            "worst": _rounded(max(values.values())),
            "worst_seed": max(values, key=lambda seed: values[seed]),
        }
    return table | {
        "vehicles": len(vehicles),
        "lost": [seed for seed, one in vehicles.items() if one.lost],
        "touched_floor": [seed for seed, one in vehicles.items() if one.touched_floor],
        "limit_cycles": [seed for seed, one in vehicles.items() if one.limit_cycle],
        "fallbacks": sum(one.fallbacks for one in vehicles.values()),
    }


def _rounded(value: float) -> float:
    return round(float(value), 3)


def draw_family(figures: Mapping[LevelName, Mapping[str, Sequence[float]]], preset: str, figure: Any) -> None:
    """Draw cumulative distributions over the vehicles, and the targets of hover.

    `figures` has one value per vehicle, by level and name.
    """
    figure.set_size_inches(11, 4.5)
    for axes, (name, label) in zip(figure.subplots(1, len(PANELS), sharey=True), PANELS.items(), strict=True):
        for index, (level, values) in enumerate(figures.items()):
            ordered = np.sort(values[name])
            share = np.arange(1, len(ordered) + 1) / len(ordered)
            axes.step(
                ordered, share, where="post", color=f"C{index}", label=f"{', '.join(level)} ({len(ordered)})"
            )
            if name == "hover_mm":
                axes.plot(
                    TARGETS_MM[level], (0.5, 1.0), "o", color=f"C{index}", fillstyle="none", clip_on=False
                )
        axes.set_xlabel(label)
        axes.set_xlim(left=0.0)
    figure.axes[0].set_ylabel("part of the vehicles")
    figure.axes[0].legend(fontsize="small", loc="lower right", title="circles: targets of median and worst")
    finish_figure(figure, f"Vehicles drawn from the family, conditions `{preset}`")
