"""The paper's Fig. 3: three vehicles keep their formation for five minutes.

Set points of the leader, distances and relative headings change every six seconds; the same flight is flown
by the paper's scheme and the default, on the same seeds; `rcopterx arena` compares others.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import MOTION_SIZE, YAW, Array
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.experiments.events import FollowEvent, GoToEvent, PilotEvent
from rcopterx_studies.experiments.knowledge import COAXIAL_LAG
from rcopterx_studies.experiments.record import FlightRecord, rms_and_max_mm
from rcopterx_studies.experiments.rig import PERIOD_S, SETTLED_S, Progress, Rig, RigVehicle
from rcopterx_studies.experiments.runner import Cases, Experiment, FlightResult, Options
from rcopterx_studies.experiments.schemes import CASCADE, PAPER, FlownScheme
from rcopterx_studies.figures import finish_figure

LEADER: Final = "h1"
FOLLOWERS: Final = ("h2", "h3")
SLOT_S: Final = 6.0
QUICK_SLOTS: Final = 7

HALF: Final = math.pi
QUARTER: Final = math.pi / 2

NEAR: Final[dict[str, Three]] = {"h2": (-0.4, 0.5, 0.0), "h3": (-0.4, -0.5, 0.0)}
WIDE: Final[dict[str, Three]] = {"h2": (-0.6, 0.4, 0.2), "h3": (-0.6, -0.4, 0.2)}
LINE: Final[dict[str, Three]] = {"h2": (-0.35, 0.0, 0.0), "h3": (-0.7, 0.0, 0.0)}

Slot = tuple[tuple[str, Three, float], ...]
"""What changes at one time: vehicle, then set point [m] or distance to the leader [m], and heading [rad]."""

SLOTS: Final[tuple[Slot, ...]] = (
    (("h1", (0.3, 0.0, 1.4), 0.0),),
    (("h1", (0.3, 0.3, 1.4), 0.0),),
    (("h2", WIDE["h2"], 0.0), ("h3", WIDE["h3"], 0.0)),
    (("h1", (-0.5, 0.3, 1.4), 0.0),),
    (("h1", (-0.5, 0.3, 1.0), 0.0),),
    (("h1", (-0.5, 0.3, 1.0), 3 * HALF),),
    (("h1", (0.0, 0.3, 1.0), 2 * HALF),),
    (("h2", NEAR["h2"], 0.0),),
    (("h3", NEAR["h3"], 0.0),),
    (("h1", (0.3, 0.1, 1.2), 2 * HALF),),
    (("h2", NEAR["h2"], QUARTER), ("h3", NEAR["h3"], -QUARTER)),
    (("h1", (0.3, 0.1, 1.2), HALF),),
    (("h1", (-0.2, -0.2, 1.2), HALF),),
    (("h1", (0.1, 0.2, 1.2), 2 * HALF),),
    (("h2", NEAR["h2"], 0.0), ("h3", NEAR["h3"], 0.0)),
    (("h2", LINE["h2"], 0.0),),
    (("h3", LINE["h3"], 0.0),),
    (("h1", (0.5, -0.3, 1.0), 2 * HALF),),
    (("h1", (0.5, -0.3, 1.5), QUARTER),),
    (("h1", (0.5, 0.3, 1.5), QUARTER),),
    (("h2", NEAR["h2"], 0.0),),
    (("h3", NEAR["h3"], 0.0),),
    (("h1", (0.0, 0.0, 1.0), QUARTER),),
    (("h1", (0.0, 0.0, 1.0), 0.0),),
)
"""One round. The second one is its mirror image: y and headings change sign, h2 and h3 change roles."""


SCHEMES: Final = (PAPER, CASCADE)
DRAWN_S: Final = 0.1
COLOURS: Final = {"x": "black", "y": "tab:red", "z": "tab:blue", "psi": "tab:green"}
MILLIMETRES: Final = 1000.0
YAW_MAGNIFICATION: Final = 100.0  # headings are drawn in hundredths of a radian, as in the paper


@dataclass(frozen=True)
class FlownFormation:
    """One flight: errors [m] while settled, largest excess over the bounds, fallbacks, and what is drawn.

    `tracks` has true position and yaw of h1, h2 and h3 every `DRAWN_S`, and what was wanted, shape
    (K, 3, 2, 4).
    """

    errors_m: Array
    gap_errors_m: Array
    excess: Array
    fallbacks: dict[str, int]
    tracks: Array


def mirrored(slots: Sequence[Slot]) -> tuple[Slot, ...]:
    """Mirror image of a sequence in the plane y = 0, in which the followers change roles."""
    other = {LEADER: LEADER, "h2": "h3", "h3": "h2"}
    return tuple(tuple((other[name], (x, -y, z), -yaw) for name, (x, y, z), yaw in slot) for slot in slots)


def sequence(quick: bool = False) -> tuple[Slot, ...]:
    """Everything that changes, slot by slot: 48 slots, with a slot before and after, fill five minutes."""
    return SLOTS[:QUICK_SLOTS] if quick else SLOTS + mirrored(SLOTS)


def events(slots: Iterable[Slot], begun_s: float = 0.0) -> list[PilotEvent]:
    """Events of a sequence, one slot every six seconds from the sixth second after its beginning on."""
    result: list[PilotEvent] = []
    for index, slot in enumerate(slots, 1):
        at_s = begun_s + index * SLOT_S
        for name, position_m, yaw_rad in slot:
            if name == LEADER:
                result.append(GoToEvent(at_s, name, position_m, yaw_rad))
            else:
                result.append(FollowEvent(at_s, name, (following(position_m, yaw_rad),)))
    return result


def following(offset_m: Three, yaw_offset_rad: float = 0.0) -> LeaderLink:
    """Follow the leader at a distance in the inertial frame, as in the paper."""
    return LeaderLink(leader=LEADER, offset_m=offset_m, yaw_offset_rad=yaw_offset_rad)


def formation(scheme: FlownScheme, conditions: Conditions, seed: int) -> list[RigVehicle]:
    """One leader and two followers in the air, a metre above the floor."""
    leader = scheme.vehicle(LEADER, BodyPose((0.0, 0.0, 1.0)), conditions, seed)
    followers = [
        scheme.vehicle(name, BodyPose((x, y, 1.0 + z)), conditions, seed, (following((x, y, z)),))
        for name, (x, y, z) in NEAR.items()
    ]
    return [leader, *followers]


def fly_formation(
    scheme: FlownScheme,
    slots: Sequence[Slot],
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> FlownFormation:
    """Fly the sequence once."""
    vehicles = formation(scheme, conditions, seed)
    record = Rig(vehicles, conditions, seed).fly((len(slots) + 2) * SLOT_S, events(slots), progress)
    return FlownFormation(
        record.formation_error_m(SETTLED_S),
        record.gap_error_m(*FOLLOWERS, SETTLED_S),
        bound_excess(record),
        dict(record.fallbacks()),
        tracks_of(record),
    )


def tracks_of(record: FlightRecord) -> Array:
    """Tracks of a flight, see `FlownFormation`."""
    wanted = [record[LEADER].reference, *(record[name].station for name in FOLLOWERS)]
    pairs = [
        np.stack((record[name].motion[:, :4], place), axis=1)
        for name, place in zip((LEADER, *FOLLOWERS), wanted, strict=True)
    ]
    return np.stack(pairs, axis=1)[:: round(DRAWN_S / PERIOD_S)]


def bound_excess(record: FlightRecord) -> Array:
    """Largest true excess of any vehicle over the state bounds, shape (7,); zero where they are kept."""
    bounded = [index for index in range(MOTION_SIZE) if index != YAW]
    worst = np.zeros(len(bounded))
    for vehicle in record.values():
        states = vehicle.motion[vehicle.time_s >= SETTLED_S][:, bounded]
        over = np.maximum(states - COAXIAL_LAG.state_max, COAXIAL_LAG.state_min - states)
        worst = np.maximum(worst, over.max(axis=0))
    return worst


def cases(options: Options) -> Cases[FlownFormation]:
    """Every scheme."""
    slots = sequence(options.quick)
    return {scheme.name: partial(fly_formation, scheme, slots) for scheme in SCHEMES}


def figures(_: str, flights: Mapping[int, FlownFormation]) -> dict[str, Any]:
    """Figures of flights together, and each seed by itself where there are several."""
    table = figures_of(list(flights.values()))
    if len(flights) > 1:
        table["per_seed"] = {str(seed): figures_of([flight]) for seed, flight in flights.items()}
    return table


def figures_of(flights: Sequence[FlownFormation]) -> dict[str, Any]:
    """Figures of flights together, lengths in millimetres."""
    errors = np.concatenate([flight.errors_m for flight in flights])
    excess = np.max([flight.excess for flight in flights], axis=0)
    between = rms_and_max_mm(np.concatenate([flight.gap_errors_m for flight in flights]), digits=3)
    return {
        **rms_and_max_mm(errors, digits=3),
        **{f"between_followers_{name}": value for name, value in between.items()},
        "bound_excess": {
            "position_m": round(float(excess[:3].max()), 4),
            "velocity_m_s": round(float(excess[3:6].max()), 4),
            "yaw_rate_rad_s": round(float(excess[6]), 4),
        },
        "fallbacks": dict(sum((Counter(flight.fallbacks) for flight in flights), Counter[str]())),
    }


def draw_formation(result: FlightResult[FlownFormation], figure: Any) -> None:
    """Draw flights side by side: the leader, the distances to it, and between the followers."""
    figure.set_size_inches(7.5 * len(SCHEMES), 12)
    axes = figure.subplots(4, len(SCHEMES), sharex=True, sharey="row", squeeze=False)
    for column, scheme in enumerate(SCHEMES):
        axes[0, column].set_title(scheme.title)
        tracks = next(iter(result.flown[scheme.name].values())).tracks
        leader, second, third = tracks.transpose(1, 0, 2, 3)
        gaps = (second - leader[:, :1], third - leader[:, :1], third - second)
        for row, pair in enumerate((leader, *map(_without_turns, gaps))):
            _draw_four(axes[row, column], pair)
        axes[3, column].set_xlabel("time [s]")
    for row, label in enumerate(("leader", "h1 to h2", "h1 to h3", "h2 to h3")):
        axes[row, 0].set_ylabel(f"{label} [mm, 0.01 rad]")
    axes[0, 0].legend(ncols=4, fontsize="small", loc="upper left")
    finish_figure(figure, "Set points (dashed) and flight (solid)")


def _without_turns(pair: Array) -> Array:
    """Differences between two vehicles without whole turns, which each of them counts by itself."""
    turned = pair.copy()
    turned[:, 0, 3] -= 2 * np.pi * np.round((pair[:, 0, 3] - pair[:, 1, 3]) / (2 * np.pi))
    return turned


def _draw_four(axes: Any, pair: Array) -> None:
    """Draw position and heading, flown and wanted."""
    time_s = DRAWN_S * np.arange(len(pair))
    for index, (name, colour) in enumerate(COLOURS.items()):
        scale = YAW_MAGNIFICATION if name == "psi" else MILLIMETRES
        axes.plot(time_s, scale * pair[:, 1, index], color=colour, linestyle="--", linewidth=0.8)
        axes.plot(time_s, scale * pair[:, 0, index], color=colour, linewidth=1.0, label=name)


EXPERIMENT: Final = Experiment(
    "formation",
    "Fig. 3: formation errors over five minutes",
    {"laboratory": 5},
    cases,
    figures,
    draw_formation,
)
