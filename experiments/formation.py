"""The paper's Fig. 3: three vehicles keep their formation for five minutes, scheme against scheme.

Set points of the leader, distances and relative headings change every six seconds; the same flight is flown
by every scheme, on the same seeds.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.controllers.registry import CONTROLLERS
from rcopterx.experiments.events import Event, Follow, GoTo
from rcopterx.experiments.record import FlightRecord, rms_and_max_mm
from rcopterx.experiments.rig import SETTLED_S, Progress, Rig, RigOptions, RigVehicle
from rcopterx.experiments.runner import Options, Result, ShowProgress, fly_presets
from rcopterx.experiments.schemes import CASCADE, HORIZON, PAPER, Scheme, compared
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import MOTION_SIZE, YAW, Array
from rcopterx.vehicles.tuples import Three
from rcopterx.vehicles.types import COAXIAL_LAG

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


SHOWN: Final = (PAPER.name, CASCADE.name)
"""Schemes whose first flight is drawn."""


COLOURS: Final = {"x": "black", "y": "tab:red", "z": "tab:blue", "psi": "tab:green"}
MILLIMETRES: Final = 1000.0
YAW_MAGNIFICATION: Final = 100.0
"""Headings are drawn in hundredths of a radian, as in the paper."""


@dataclass(frozen=True)
class Flown:
    """One flight: errors [m] while settled, largest excess over the bounds, fallbacks, perhaps the record."""

    errors_m: Array
    gap_errors_m: Array
    excess: Array
    fallbacks: dict[str, int]
    record: FlightRecord | None


def mirrored(slots: Sequence[Slot]) -> tuple[Slot, ...]:
    """Mirror image of a sequence in the plane y = 0, in which the followers change roles."""
    other = {LEADER: LEADER, "h2": "h3", "h3": "h2"}
    return tuple(tuple((other[name], (x, -y, z), -yaw) for name, (x, y, z), yaw in slot) for slot in slots)


def sequence(quick: bool = False) -> tuple[Slot, ...]:
    """Everything that changes, slot by slot: 48 slots, with a slot before and after, fill five minutes."""
    return SLOTS[:QUICK_SLOTS] if quick else SLOTS + mirrored(SLOTS)


def events(slots: Iterable[Slot]) -> list[Event]:
    """Events of a sequence, one slot every six seconds from the sixth second on."""
    result: list[Event] = []
    for index, slot in enumerate(slots, 1):
        for name, position_m, yaw_rad in slot:
            if name == LEADER:
                result.append(GoTo(index * SLOT_S, name, position_m, yaw_rad))
            else:
                result.append(Follow(index * SLOT_S, name, (following(position_m, yaw_rad),)))
    return result


def following(offset_m: Three, yaw_offset_rad: float = 0.0) -> LeaderLink:
    """Follow the leader at a distance in the inertial frame, as in the paper."""
    return LeaderLink(leader=LEADER, offset_m=offset_m, yaw_offset_rad=yaw_offset_rad)


def formation(scheme: Scheme, conditions: Conditions, seed: int, horizon: int = HORIZON) -> list[RigVehicle]:
    """One leader and two followers in the air, a metre above the floor."""
    leader = scheme.vehicle(LEADER, Pose((0.0, 0.0, 1.0)), conditions, seed, horizon)
    followers = [
        scheme.vehicle(
            name,
            Pose((NEAR[name][0], NEAR[name][1], 1.0 + NEAR[name][2])),
            conditions,
            seed,
            horizon,
            (following(NEAR[name]),),
        )
        for name in FOLLOWERS
    ]
    return [leader, *followers]


def fly_formation(
    scheme: Scheme,
    slots: Sequence[Slot],
    recorded_seed: int | None,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> Flown:
    """Fly the sequence once; the flight of `recorded_seed` is returned with its record."""
    vehicles = formation(scheme, conditions, seed)
    rig = Rig(vehicles, conditions, seed, RigOptions(previous_frame=scheme.previous_frame))
    record = rig.fly((len(slots) + 2) * SLOT_S, events(slots), progress)
    return Flown(
        record.formation_error_m(SETTLED_S),
        record.gap_error_m(*FOLLOWERS, SETTLED_S),
        bound_excess(record),
        dict(record.fallbacks()),
        record if seed == recorded_seed else None,
    )


def bound_excess(record: FlightRecord) -> Array:
    """Largest true excess of any vehicle over the state bounds, shape (7,); zero where they are kept."""
    bounded = [index for index in range(MOTION_SIZE) if index != YAW]
    worst = np.zeros(len(bounded))
    for vehicle in record.vehicles.values():
        states = vehicle.motion[vehicle.time_s >= SETTLED_S][:, bounded]
        over = np.maximum(states - COAXIAL_LAG.state_max, COAXIAL_LAG.state_min - states)
        worst = np.maximum(worst, over.max(axis=0))
    return worst


def flown_schemes(conditions: Conditions) -> dict[str, Scheme]:
    """Schemes of these conditions whose controllers are installed, by name."""
    available = CONTROLLERS.available()
    return {name: scheme for name, scheme in compared(conditions).items() if scheme.controller in available}


def run(options: Options, show: ShowProgress) -> Result:
    """Fly every scheme on every seed, and first-order plants once in ideal conditions.

    Returns
    -------
    Result
        Document: condition -> scheme -> figures.
    """
    slots = sequence(options.quick)
    schemes = flown_schemes(options.conditions)
    first = options.seeds[0]
    # The name says which flight is recorded, so that a kept flight without its record is not taken for it.
    names = {name: f"{name}, seed {first} recorded" if name in SHOWN else name for name in schemes}
    flights = {
        names[name]: partial(fly_formation, scheme, slots, first if name in SHOWN else None)
        for name, scheme in schemes.items()
    }
    flown = {
        preset: {name: by_name[names[name]] for name in schemes}
        for preset, by_name in fly_presets(flights, options.beside_ideal, options, show).items()
    }
    records = {
        schemes[name].title: record
        for name in SHOWN
        if name in schemes and (record := flown[options.preset][name][first].record) is not None
    }
    return Result(document(flown), partial(draw_formation, records))


def document(flown: Mapping[str, Mapping[str, Mapping[int, Flown]]]) -> dict[str, Any]:
    """Figures of flights by condition, scheme and seed; each seed by itself except in ideal conditions."""
    table: dict[str, dict[str, dict[str, Any]]] = {}
    for preset, schemes in flown.items():
        table[preset] = {name: figures(list(flights.values())) for name, flights in schemes.items()}
        if preset != "ideal":
            for name, flights in schemes.items():
                table[preset][name]["per_seed"] = {
                    str(seed): figures([flight]) for seed, flight in flights.items()
                }
    return table


def figures(flights: Sequence[Flown]) -> dict[str, Any]:
    """Figures of flights together, lengths in millimetres."""
    errors = np.concatenate([flight.errors_m for flight in flights])
    excess = np.max([flight.excess for flight in flights], axis=0)
    between = rms_and_max_mm(np.concatenate([flight.gap_errors_m for flight in flights]), digits=3)
    fallbacks: Counter[str] = Counter()
    for flight in flights:
        fallbacks.update(flight.fallbacks)
    return {
        **rms_and_max_mm(errors, digits=3),
        **{f"between_followers_{name}": value for name, value in between.items()},
        "bound_excess": {
            "position_m": round(float(excess[:3].max()), 4),
            "velocity_m_s": round(float(excess[3:6].max()), 4),
            "yaw_rate_rad_s": round(float(excess[6]), 4),
        },
        "fallbacks": dict(fallbacks),
    }


def draw_formation(records: Mapping[str, FlightRecord], figure: Any) -> None:
    """Draw flights by title side by side: the leader, the distances to it, and between the followers."""
    figure.set_size_inches(7.5 * len(records), 12)
    axes = figure.subplots(4, len(records), sharex=True, sharey="row", squeeze=False)
    for column, (title, record) in enumerate(records.items()):
        leader, second, third = (record[name] for name in ("h1", "h2", "h3"))
        time_s = leader.time_s
        axes[0, column].set_title(title)
        _draw_four(axes[0, column], time_s, leader.motion[:, :4], leader.reference)
        for row, follower in ((1, second), (2, third)):
            gap, wanted = (
                states - leader.motion[:, :4] for states in (follower.motion[:, :4], follower.station)
            )
            _draw_four(axes[row, column], time_s, _without_turns(gap, wanted), wanted)
        between, wanted = (third.motion - second.motion)[:, :4], third.station - second.station
        _draw_four(axes[3, column], time_s, _without_turns(between, wanted), wanted)
        axes[3, column].set_xlabel("time [s]")
    for row, label in enumerate(("leader", "h1 to h2", "h1 to h3", "h2 to h3")):
        axes[row, 0].set_ylabel(f"{label} [mm, 0.01 rad]")
    axes[0, 0].legend(ncols=4, fontsize="small", loc="upper left")
    figure.suptitle("Set points (dashed) and flight (solid)")
    figure.tight_layout()


def _without_turns(flown: Array, wanted: Array) -> Array:
    """Differences between two vehicles without whole turns, which each of them counts by itself."""
    turns = np.round((flown[:, 3] - wanted[:, 3]) / (2 * np.pi))
    return np.column_stack((flown[:, :3], flown[:, 3] - 2 * np.pi * turns))


def _draw_four(axes: Any, time_s: Array, flown: Array, wanted: Array) -> None:
    """Draw position and heading."""
    for index, (name, colour) in enumerate(COLOURS.items()):
        scale = YAW_MAGNIFICATION if name == "psi" else MILLIMETRES
        axes.plot(time_s, scale * wanted[:, index], color=colour, linestyle="--", linewidth=0.8)
        axes.plot(time_s, scale * flown[:, index], color=colour, linewidth=1.0, label=name)
    axes.grid(alpha=0.3)
