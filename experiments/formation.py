"""The paper's Fig. 3: three vehicles keep their formation for five minutes, scheme against scheme.

Set points of the leader, distances and relative headings change every six seconds; the same flight is flown
by every scheme, on the same seeds.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.controllers.registry import CONTROLLERS
from rcopterx.experiments.events import Event, Follow, GoTo
from rcopterx.experiments.formation_figure import draw_formation
from rcopterx.experiments.record import FlightRecord, rms, total_fallbacks
from rcopterx.experiments.rig import Progress, Rig, RigOptions, RigVehicle
from rcopterx.experiments.runner import Options, Result, Tell, Work, run_all
from rcopterx.experiments.schemes import CASCADE, HORIZON, PAPER, Scheme, compared
from rcopterx.simulator.conditions import PRESETS, Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import MOTION_SIZE, YAW, Array
from rcopterx.vehicles.tuples import Three
from rcopterx.vehicles.types import COAXIAL_LAG

LEADER: Final = "h1"
FOLLOWERS: Final = ("h2", "h3")
SLOT_S: Final = 6.0
SETTLED_S: Final = 5.0
"""Errors count from here on: estimators start at rest without knowing trim and turbulence."""
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


@dataclass(frozen=True)
class Case:
    """One flight: a scheme by name, conditions by name, a seed."""

    scheme: str
    condition: str
    seed: int


@dataclass(frozen=True)
class Flown:
    """Figures of one flight: errors [m] while settled, largest excess over the bounds, fallbacks."""

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
    conditions: Conditions,
    seed: int,
    slots: Sequence[Slot],
    keep: bool,
    progress: Progress | None = None,
) -> Flown:
    """Fly the sequence once.

    Parameters
    ----------
    scheme
        Controller of all three vehicles.
    conditions, seed
        The laboratory.
    slots
        What changes.
    keep
        Whether to return the whole record.
    progress
        Told the fraction flown.

    Returns
    -------
    Flown
        Errors of both followers.
    """
    vehicles = formation(scheme, conditions, seed)
    rig = Rig(vehicles, conditions, seed, RigOptions(previous_frame=scheme.previous_frame))
    record = rig.fly((len(slots) + 2) * SLOT_S, events(slots), progress)
    return Flown(
        record.formation_error_m(SETTLED_S),
        record.gap_error_m(*FOLLOWERS, SETTLED_S),
        bound_excess(record),
        dict(total_fallbacks(record)),
        record if keep else None,
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


def run(options: Options, tell: Tell) -> Result:
    """Fly every scheme on every seed, and beside first-order plants once in ideal conditions.

    Returns
    -------
    Result
        Document: condition -> scheme -> figures.
    """
    slots = sequence(options.quick)
    schemes = flown_schemes(options.conditions)
    cases = [
        Case(scheme, condition, seed)
        for scheme in schemes
        for condition, seeds in options.beside_ideal.items()
        for seed in seeds
    ]
    shown = [Case(scheme.name, options.preset, options.seeds[0]) for scheme in (PAPER, CASCADE)]
    works = [
        Work(
            f"{case.scheme}, {case.condition}, seed {case.seed}" + (", recorded" if case in shown else ""),
            partial(
                fly_formation,
                schemes[case.scheme],
                PRESETS[case.condition],
                case.seed,
                slots,
                case in shown,
            ),
        )
        for case in cases
    ]
    flights = dict(zip(cases, run_all(works, options, tell), strict=True))
    records = {
        schemes[case.scheme].title: record for case in shown if (record := flights[case].record) is not None
    }
    return Result(document(flights), partial(draw_formation, records))


def document(flights: Mapping[Case, Flown]) -> dict[str, Any]:
    """Figures of all flights: condition -> scheme -> figures; except for ideal conditions by seed as well."""
    groups: dict[str, dict[str, dict[str, Flown]]] = {}
    for case, flight in flights.items():
        schemes = groups.setdefault(case.condition, {})
        schemes.setdefault(case.scheme, {})[str(case.seed)] = flight
    table = {
        condition: {scheme: figures(list(flown.values())) for scheme, flown in schemes.items()}
        for condition, schemes in groups.items()
    }
    for condition in groups.keys() - {"ideal"}:
        for scheme, flown in groups[condition].items():
            per_seed = {seed: figures([flight]) for seed, flight in flown.items()}
            table[condition][scheme]["per_seed"] = per_seed
    return table


def figures(flights: Sequence[Flown]) -> dict[str, Any]:
    """Figures of flights together, lengths in millimetres."""
    errors = np.concatenate([flight.errors_m for flight in flights])
    gaps = np.concatenate([flight.gap_errors_m for flight in flights])
    excess = np.max([flight.excess for flight in flights], axis=0)
    fallbacks: dict[str, int] = {}
    for flight in flights:
        for kind, count in flight.fallbacks.items():
            fallbacks[kind] = fallbacks.get(kind, 0) + count
    return {
        "rms_mm": round(1000 * rms(errors), 3),
        "max_mm": round(1000 * float(errors.max()), 3),
        "between_followers_rms_mm": round(1000 * rms(gaps), 3),
        "between_followers_max_mm": round(1000 * float(gaps.max()), 3),
        "bound_excess": {
            "position_m": round(float(excess[:3].max()), 4),
            "velocity_m_s": round(float(excess[3:6].max()), 4),
            "yaw_rate_rad_s": round(float(excess[6]), 4),
        },
        "fallbacks": fallbacks,
    }
