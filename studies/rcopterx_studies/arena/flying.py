"""Flying a task with a scheme, and the figures of the flight."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.agents.pilot import CONTROLLER_REPLACED
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import Plan
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.control.plugins import CONTROLLERS, SCHEMES
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import XD_BODY, Array, four
from rcopterx_studies.arena.tasks import ArenaTask
from rcopterx_studies.experiments.record import FlightRecord, rms, rms_and_max_mm
from rcopterx_studies.experiments.rig import PERIOD_S, Progress, Rig
from rcopterx_studies.experiments.schemes import TUNED, FlownScheme

ROOM_M: Final = 3.0
CLOSE_M: Final = 0.3
LOST_M: Final = 0.5
FAST: Final = 1.1
"""Closer vehicles, and velocities beyond their bounds by this factor, violate constraints; further from its
place at the end, a vehicle is lost."""
DRAWN_S: Final = 0.2


def arena_scheme(name: str) -> FlownScheme:
    """Scheme or controller of this name, with the settings that the experiments use for helicopters."""
    return TUNED.get(name, FlownScheme(name, name, name))


def arena_schemes() -> list[str]:
    """Names of all schemes, and of the controllers that take part with the plans of their leaders."""
    return sorted({*SCHEMES.available(), *CONTROLLERS.available(), *TUNED})


@dataclass(frozen=True)
class FlownTask:
    """Figures of one flight."""

    # distance of followers from where their leaders truly are plus the offset
    rms_mm: float
    max_mm: float
    # distance of vehicles without leaders from their reference
    task_rms_mm: float
    task_max_mm: float
    closest_mm: float  # smallest distance between two vehicles
    violated_s: float  # time in which vehicles were too close or a velocity was beyond its bounds
    # messages of schemes, or plans, per vehicle
    messages_per_s: float
    bytes_per_s: float
    # processor time of an agent per control period
    step_mean_ms: float
    step_p99_ms: float
    fallbacks: int
    # vehicles that left the room, touched the floor, got another controller or ended far from their places
    lost: list[str]
    tracks_m: Array  # x and y of each vehicle every 0.2 s, shape (vehicles, K, 2)


def fly_task(
    scheme: FlownScheme, task: ArenaTask, conditions: Conditions, seed: int, progress: Progress | None = None
) -> FlownTask:
    """Fly a task once."""
    room_m = (-ROOM_M, -ROOM_M, 0.0), (ROOM_M, ROOM_M, ROOM_M)
    rough = four(task.turbulence * np.array(conditions.turbulence_rms))
    conditions = replace(conditions, turbulence_rms=rough, volume_min_m=room_m[0], volume_max_m=room_m[1])
    vehicles = []
    for name, place in task.starts_m.items():
        vehicle = scheme.vehicle(name, BodyPose(place), conditions, seed, task.links.get(name, ()))
        # All schemes get the same references.
        vehicles.append(replace(vehicle, model=vehicle.model.within(*room_m), as_published=False))
    rig = Rig(vehicles, conditions, seed, task.options)
    record = rig.fly(task.duration_s, task.events, progress)
    bounds = {name: np.array(pilot.model.state_max[3:6]) for name, pilot in rig.pilots.items()}
    steps_s = np.concatenate([rig.step_times_s[name] for name in rig.pilots])
    return figures_of(record, task.errors_from_s, bounds, _traffic(rig), steps_s)


def figures_of(
    record: FlightRecord,
    from_s: float,
    bounds_m_s: Mapping[str, Array],
    traffic: "MessageTraffic",
    steps_s: Array,
) -> FlownTask:
    """Figures of a flight: bounds of velocities by vehicle, shape (3,); times of steps, shape (n,)."""
    errors = {name: vehicle.formation_error_m(from_s) for name, vehicle in record.items()}
    on_task = {}
    for name, vehicle in record.items():
        alone = np.isnan(vehicle.station[vehicle.time_s >= from_s, 0])
        off = np.linalg.norm(vehicle.reference_error(from_s)[alone, :3], axis=1)
        on_task[name] = off[np.isfinite(off)]
    duration_s = PERIOD_S * len(next(iter(record.values())).time_s)
    distances = _distances(record)
    fast = np.zeros(distances.shape[1], dtype=bool)
    for name, vehicle in record.items():
        fast |= (np.abs(vehicle.motion[:, XD_BODY : XD_BODY + 3]) > FAST * bounds_m_s[name]).any(axis=1)
    return FlownTask(
        *_rms_and_max_mm(errors),
        *_rms_and_max_mm(on_task),
        round(1000.0 * float(distances.min()), 1),
        round(PERIOD_S * int((fast | (distances < CLOSE_M).any(axis=0)).sum()), 2),
        round(traffic.messages / duration_s / len(record), 2),
        round(traffic.bytes / duration_s / len(record), 1),
        round(1000.0 * float(steps_s.mean()), 3),
        round(1000.0 * float(np.percentile(steps_s, 99)), 3),
        sum(record.fallbacks().values()),
        [name for name in record if _lost(record, name, (*errors[name][-1:], *on_task[name][-1:]))],
        np.stack([vehicle.motion[:: round(DRAWN_S / PERIOD_S), :2] for vehicle in record.values()]).round(3),
    )


def _rms_and_max_mm(errors_m: Mapping[str, Array]) -> tuple[float, float]:
    together = np.concatenate(list(errors_m.values()))
    figures_mm = rms_and_max_mm(together if len(together) else np.zeros(1))
    return figures_mm["rms_mm"], figures_mm["max_mm"]


def _distances(record: FlightRecord) -> Array:
    """Distances of all pairs in all control periods, shape (pairs, K) [m]."""
    places = [vehicle.motion[:, :3] for vehicle in record.values()]
    return np.array([np.linalg.norm(one - other, axis=1) for one, other in combinations(places, 2)])


def _lost(record: FlightRecord, name: str, errors_m: Sequence[float]) -> bool:
    vehicle = record[name]
    gone = vehicle.left_volume or vehicle.touchdowns > 0 or vehicle.fallbacks.get(CONTROLLER_REPLACED, 0) > 0
    return gone or max(errors_m, default=0.0) > LOST_M


class MessageTraffic(NamedTuple):
    """Messages of a flight."""

    messages: int
    bytes: int


def _traffic(rig: Rig) -> MessageTraffic:
    """Number and bytes of all messages: those of schemes, else the plans."""
    if rig.message_network.sent:
        return MessageTraffic(rig.message_network.sent, rig.message_network.bytes)
    return MessageTraffic(rig.plan_network.sent, rig.plan_network.sent * _plan_bytes(rig))


def _plan_bytes(rig: Rig) -> int:
    """Size of a plan on the bus, which hardly changes."""
    name, pilot = next(iter(rig.pilots.items()))
    assert pilot.plan is not None
    samples = TrajectoryArray.of(pilot.plan.samples)
    plan = Plan(
        epoch=1, frame=1, source=name, ancestors=(), period_s=PERIOD_S, start_s=pilot.model.delay_s,
        trajectory=samples, nominal=samples,
    )  # fmt: skip
    return len(encode(plan))


TIMES: Final = ("step_mean_ms", "step_p99_ms")
"""Figures that depend on the computer, and are no part of the digest."""
_WORST: Final[Mapping[str, Callable[[Array], float]]] = {
    "max_mm": np.max, "task_max_mm": np.max, "closest_mm": np.min, "step_p99_ms": np.max,
    "rms_mm": rms, "task_rms_mm": rms,
}  # fmt: skip
"""How flights are summarised; the others by their means."""


def figures(_: str, flights: Mapping[int, FlownTask]) -> dict[str, Any]:
    """Figures of the flights of one scheme and task together, over the seeds."""
    rows = [asdict(flown) for flown in flights.values()]
    table = {
        name: round(float(_WORST.get(name, np.mean)(np.array([row[name] for row in rows]))), 3)
        for name in rows[0]
        if name not in ("lost", "tracks_m")
    }
    return {**table, "lost": {str(seed): flown.lost for seed, flown in flights.items() if flown.lost}}
