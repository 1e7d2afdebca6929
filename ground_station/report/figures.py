"""Figures of a flight from its recording: latencies, errors, ticks, fallbacks."""

import math
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain, groupby, pairwise
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle, RouterStatus
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied, Diagnostics, Plan, Pose
from rcopterx.control.interfaces import Measurement
from rcopterx.formation.topology import station
from rcopterx.ground_station.report.latency import clock_offset, stage_times_ms
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.report.statistics import rms_and_max
from rcopterx.vehicles.state import Array

F = TypeVar("F", LaboratoryState, Pose, Plan, Applied)
M = TypeVar("M", bound=Message)
S = TypeVar("S", Pose, Plan, Applied)

PULSE_TOLERANCE_US = 1.0
MATCH_LIMIT_S = 0.1
TO_COMMAND = {"gateway", "agent", "solver", "command"}  # stages from the Vicon to the transmitter gateway
SETTLED_S = 3.0  # a vehicle that leads shall have reached its set point this long after it changed
AT_REST_M = 0.001
LONGEST_LATENCY_MS = 1000.0  # events that are further apart do not belong together


def restart_offsets(frames: Iterable[int]) -> list[int]:
    """What to add to each of these frame numbers, in order, so that they continue after a jump back."""
    offsets, offset = [], 0
    for before, frame in pairwise((0, *frames)):
        if frame < before:
            offset += before + 1 - frame
        offsets.append(offset)
    return offsets


def epoch_offsets(poses: Iterable[Pose], true_offsets: Sequence[int]) -> Mapping[int, int]:
    """What to add to frame numbers of each epoch; those of the simulated laboratory have `true_offsets`."""
    stamps = sorted({(pose.epoch, pose.frame) for pose in poses})
    offsets = restart_offsets(frame for _, frame in stamps)
    # States of the laboratory have no epoch, but as many restarts, at frames that may have no pose.
    true = dict(zip(dict.fromkeys(offsets), dict.fromkeys(true_offsets), strict=False))
    return {epoch: true.get(offset, offset) for (epoch, _), offset in zip(stamps, offsets, strict=True)}


def shifted(message: F, offset: int) -> F:
    """Return a message with `offset` added to its frame number."""
    return structs.replace(message, frame=message.frame + offset) if offset else message


class FlightFigures:
    """Figures of the vehicles of a recorded flight, as in `report.json`.

    Positions are the true ones of the simulated laboratory, if any. Frame numbers continue where those of the
    Tracker restart. Clocks of hosts are compared by the offsets that routers measured during the flight.
    """

    def __init__(self, recording: Recording, vehicles: Sequence[str]) -> None:
        self._vehicles = list(vehicles)
        states = [m for m, _ in recording.messages(channels.LABORATORY, channels.SIMULATOR_UNIT)]
        true_offsets = restart_offsets(state.frame for state in states)
        self.laboratory = list(map(shifted, states, true_offsets))  # in order; empty with hardware

        def by_vehicle(channel: Channel[M]) -> dict[str, list[M]]:
            return {name: [m for m, _ in recording.messages(channel, name)] for name in vehicles}

        poses = by_vehicle(channels.POSE)
        offsets = epoch_offsets(chain.from_iterable(poses.values()), true_offsets)

        def continued(by_name: Mapping[str, list[S]]) -> dict[str, list[S]]:
            return {name: [shifted(m, offsets.get(m.epoch, 0)) for m in own] for name, own in by_name.items()}

        self._poses = continued(poses)
        self._transmitters = by_vehicle(channels.TRANSMITTER_STATUS)
        plans = {name: _plans(recording, name) for name in vehicles}
        self.plans = continued(plans)  # plans of each vehicle, in order, without those after a kill
        self.applied = continued(by_vehicle(channels.APPLIED))  # inputs written to each module, in order
        self.statuses = by_vehicle(channels.AGENT_STATUS)  # statuses of the agent of each vehicle, in order
        self._positions = {name: self._position_by_frame(name) for name in self._vehicles}
        self.stages = self._stage_times(recording)  # `stage_times_ms` of each command

    def truth(self, name: str) -> list[LaboratoryVehicle]:
        """True states of one vehicle."""
        return [state.vehicles[name] for state in self.laboratory if name in state.vehicles]

    def frame_period_s(self) -> float:
        """Time between the frames of the motion capture [s]."""
        return next((poses[0].period_s for poses in self._poses.values() if poses), 1.0)

    def flown(self, name: str) -> tuple[NDArray[np.int64], Array]:
        """Frames, shape (n,), and position [m] and yaw [rad, within a turn] of a vehicle, shape (n, 4)."""
        by_frame = self._positions[name]
        return np.array(list(by_frame), dtype=np.int64), np.array(list(by_frame.values())).reshape(-1, 4)

    def distances_m(self, first: str, second: str) -> Array:
        """Distance between two vehicles at every frame in which both were seen, shape (n,)."""
        one, two = self._positions[first], self._positions[second]
        gaps = [one[frame][:3] - two[frame][:3] for frame in one.keys() & two.keys()]
        return np.asarray(np.linalg.norm(np.array(gaps).reshape(-1, 3), axis=1))

    def _position_by_frame(self, name: str) -> dict[int, Array]:
        if self.laboratory:
            return {
                state.frame: np.array([*state.vehicles[name].position_m, state.vehicles[name].yaw_rad])
                for state in self.laboratory
                if name in state.vehicles
            }
        return {
            pose.frame: np.array(
                [*pose.position_m, Measurement.of_pose(pose.position_m, pose.quaternion_xyzw).yaw_rad]
            )
            for pose in self._poses[name]
            if pose.position_m is not None and pose.quaternion_xyzw is not None
        }

    def pose_to_command_ms(self) -> list[float]:
        """From the arrival of a frame at the Vicon gateway to that of its command at the transmitter's."""
        commands = [times for stages in self.stages.values() for times in stages]
        values = [sum(map(times.__getitem__, TO_COMMAND)) for times in commands if times.keys() >= TO_COMMAND]
        return [value for value in values if value < LONGEST_LATENCY_MS]

    def _stage_times(self, recording: Recording) -> dict[str, list[dict[str, float]]]:
        """Stages of all commands, with the statuses of routers that had arrived before each."""
        routers: dict[str, RouterStatus] = {}
        found: dict[str, list[dict[str, float]]] = {name: [] for name in self._vehicles}
        needed: tuple[Channel[Any], ...] = (channels.ROUTER_STATUS, channels.APPLIED)
        for _, unit, message in recording.in_order(needed):
            if isinstance(message, RouterStatus):
                routers[unit] = message
            elif unit in found and (times := stage_times_ms(message, partial(clock_offset, routers))):
                found[unit].append(times)
        return found

    def frame_to_radio_ms(self) -> list[float]:
        """From the simulator's send of a frame to the arrival of the first radio frame computed from it."""
        sent = {state.frame: state.sent_s for state in self.laboratory}
        values = []
        for name in self._vehicles:
            arrivals = [radio for vehicle in self.truth(name) for radio in vehicle.radio]
            seen: set[int] = set()
            for applied in self.applied[name]:
                sent_s = sent.get(applied.frame, math.inf)
                if not applied.fresh or applied.frame in seen or sent_s > applied.written_s:
                    continue
                seen.add(applied.frame)
                if (arrived_s := _arrival_of(applied, arrivals)) is not None:
                    values.append(1000 * (arrived_s - sent_s))
        return [value for value in values if value < LONGEST_LATENCY_MS]

    def formation_error_m(self, name: str) -> Array:
        """Norm of p_F - p_L - d at every frame in which the vehicle followed, shape (n,)."""
        errors = []
        own = self._positions[name]
        for plan in self.plans[name]:
            if not plan.following or plan.reference is None or plan.frame not in own:
                continue
            leading = [
                leader
                for link in plan.following
                if (leader := self._positions.get(link.leader, {}).get(plan.frame)) is not None
            ]
            if len(leading) == len(plan.following):
                place = station(plan.following, leading)
                errors.append(float(np.linalg.norm((own[plan.frame] - place)[:3])))
        return np.array(errors)

    def tracking_errors(self, name: str) -> tuple[Array, Array]:
        """Frames, shape (n,), and distances from the reference of the same moment [m], shape (n,)."""
        errors = [
            (self._reference_frame(plan), error_m)
            for plan in self.plans[name]
            if (error_m := self._distance_from_reference_m(name, plan)) is not None
        ]
        frames, errors_m = np.array(errors, dtype=float).reshape(-1, 2).T
        return frames, errors_m

    def settled_error_m(self, name: str) -> Array:
        """Distance from a reference that has been at rest for `SETTLED_S` of free flight, shape (n,)."""
        errors, since, place = [], None, np.zeros(3)
        for plan in self.plans[name]:
            if plan.reference is None or not plan.followable:
                since = None
                continue
            wanted = np.array(plan.reference[:3])
            if since is None or np.linalg.norm(wanted - place) > AT_REST_M:
                since, place = plan.frame, wanted
            error_m = self._distance_from_reference_m(name, plan)
            if error_m is not None and (plan.frame - since) * self.frame_period_s() >= SETTLED_S:
                errors.append(error_m)
        return np.array(errors)

    def _reference_frame(self, plan: Plan) -> int:
        return plan.frame + round(plan.start_s / self.frame_period_s())

    def _distance_from_reference_m(self, name: str, plan: Plan) -> float | None:
        flown = self._positions[name].get(self._reference_frame(plan))
        if plan.reference is None or flown is None:
            return None
        return float(np.linalg.norm(flown[:3] - np.array(plan.reference[:3])))

    def followed(self, name: str) -> list[str]:
        """Vehicles that a vehicle followed at any time."""
        return sorted({link.leader for plan in self.plans[name] for link in plan.following})

    def vehicle(self, name: str) -> dict[str, Any]:
        """The report's table of one vehicle."""
        overrides = (f"{one.state}: {one.reason}" for one in self._transmitters[name] if one.state != "armed")
        status = [status.diagnostics for status in self.statuses[name]]
        table: dict[str, Any] = {
            "formation_error_mm": rms_and_max(self.formation_error_m(name)),
            "tracking_error_mm": rms_and_max(self.tracking_errors(name)[1]),
            "radio_frames": dict(Counter(applied.state for applied in self.applied[name])),
            "safety": [event for event, _ in groupby(overrides)],
        }
        ticks = ("ticks", "missed_ticks", "avoiding_ticks")
        growth = _growth(status, lambda s: {name: getattr(s, name) for name in ticks})
        table |= {name: growth[name] for name in ticks}
        table["fallbacks"] = dict(_growth(status, lambda s: s.fallbacks))
        table["solve_ms"] = None
        if status:
            table["solve_ms"] = {
                "p50": round(float(np.median([s.solve_ms_p50 for s in status])), 3),
                "p99": round(max(s.solve_ms_p99 for s in status), 3),
                "max": round(max(s.solve_ms_max for s in status), 3),
            }
        return table


def _plans(recording: Recording, name: str) -> list[Plan]:
    """Plans of a vehicle, except while it is killed: its fall is no error of its control."""
    written = recording.messages(channels.APPLIED, name)
    times_s = [arrived_s for _, arrived_s in written]
    return [
        plan
        for plan, arrived_s in recording.messages(channels.PLAN, name)
        if not (before := bisect_right(times_s, arrived_s)) or written[before - 1][0].state != "killed"
    ]


def _growth(
    figures: Sequence[Diagnostics], counts: Callable[[Diagnostics], Mapping[str, int]]
) -> Counter[str]:
    """Growth of counters during a recording; a restarted agent and a new estimator count from zero."""
    grown: Counter[str] = Counter()
    for before, after in pairwise(figures):
        base = counts(before) if before.process == after.process else {}
        grown += Counter(counts(after)) - Counter(base)
    return grown


def _arrival_of(applied: Applied, arrivals: Sequence[Sequence[float]]) -> float | None:
    """Arrival [s] of the serial frame with the pulse widths that were written."""
    first = bisect_left(arrivals, applied.written_s - 0.001, key=itemgetter(0))
    for index in range(first, len(arrivals)):
        radio = arrivals[index]
        if radio[0] > applied.written_s + MATCH_LIMIT_S:
            return None
        pairs = zip(radio[1:5], applied.pulse_width_us[:4], strict=False)
        if all(abs(a - b) <= PULSE_TOLERANCE_US for a, b in pairs):
            return radio[0]
    return None
