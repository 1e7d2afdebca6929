"""Turns recorded messages into Foxglove's channels."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

import foxglove
from foxglove.channels import FrameTransformsChannel, LogChannel, PoseInFrameChannel, SceneUpdateChannel
from foxglove.messages import FrameTransforms, Log, LogLevel, SceneUpdate

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.host_messages import RouterStatus
from rcopterx.bus.messages import AgentStatus, Applied, Plan, Pose
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.events import EVENT_CHANNELS, EventFeed
from rcopterx.ground_station.foxglove import drawing
from rcopterx.ground_station.report.latency import clock_offset, stage_times_ms
from rcopterx.ground_station.scripting.state import error_of

NANO: Final = 1e9
SCENE_NS: Final = 100_000_000
"""Plans are drawn ten times a second."""
REPEAT_NS: Final = 1_000_000_000
"""Constant messages are repeated for viewers that jump in time."""
NUMBERS: Final = {"type": "object", "additionalProperties": {"type": "number"}}
"""JSON schema of plots."""


class FoxgloveView:
    """Channels of a fleet in a context of the SDK, which writes a file."""

    def __init__(self, fleet: FleetFile, context: foxglove.Context) -> None:
        # Channels are closed with their context.
        self._context = context
        self._fleet = fleet
        self._numbers = {name: number for number, name in enumerate(fleet.vehicles)}
        self._transforms = FrameTransformsChannel("/tf", context=context)
        self._scene = SceneUpdateChannel("/scene", context=context)
        self._log = LogChannel("/log", context=context)
        self._poses = self._of_each("pose", partial(PoseInFrameChannel, context=context))
        self._references = self._of_each("reference", partial(PoseInFrameChannel, context=context))
        plot = partial(foxglove.Channel, schema=NUMBERS, context=context)
        self._sticks, self._latency, self._flight = (
            self._of_each(topic, plot) for topic in ("sticks", "latency", "flight")
        )
        self._events = EventFeed()
        self._routers: dict[str, RouterStatus] = {}
        self._places: dict[str, tuple[float, float, float]] = {}
        self._drawn_ns: dict[str, int] = {}
        self._channels = {(channel.topic, channel.unit): channel for channel in channels.CHANNELS}
        self._takers: dict[type, Callable[[str, Any, int], None]] = {
            Pose: self._pose, Plan: self._plan, Applied: self._applied, AgentStatus: self._status,
            RouterStatus: self._router,
        }  # fmt: skip
        self._event_messages = {channel.message for channel in EVENT_CHANNELS}

    def _of_each(self, topic: str, make: Callable[[str], Any]) -> Mapping[str, Any]:
        return {name: make(f"/{name}/{topic}") for name in self._fleet.vehicles}

    def take(self, unit: str, topic: str, payload: bytes, time_ns: int) -> None:
        """Show a message that arrived at a time [ns since 1970]; invalid messages are left out."""
        channel = self._channel(unit, topic)
        if channel is None:
            return
        take = self._takers.get(channel.message)
        if take is None and channel.message not in self._event_messages:
            return
        try:
            message = decode(payload, channel.message)
        except RejectedError:
            return
        if take is not None:
            take(unit, message, time_ns)
        for event in self._events.take(unit, message, time_ns / NANO):
            level = LogLevel.Warning if event.alarming else LogLevel.Info
            line = Log(timestamp=drawing.stamp(time_ns), level=level, message=event.words, name=event.vehicle)
            self._log.log(line, log_time=time_ns)

    def _channel(self, unit: str, topic: str) -> Channel[Any] | None:
        """Channel of a message; None for units that the fleet file does not have."""
        if topic == channels.ANSWERED.topic:
            return channels.ANSWERED
        kind = "vehicle" if unit in self._numbers else "host" if unit in self._fleet.hosts else unit
        return self._channels.get((topic, kind))

    def _due(self, what: str, time_ns: int, period_ns: int) -> bool:
        if time_ns - self._drawn_ns.get(what, -period_ns) < period_ns:
            return False
        self._drawn_ns[what] = time_ns
        return True

    def _pose(self, name: str, seen: Pose, time_ns: int) -> None:
        if seen.position_m is None or seen.quaternion_xyzw is None:
            return
        self._places[name] = seen.position_m
        moved = drawing.transform(name, seen.position_m, seen.quaternion_xyzw, time_ns)
        self._transforms.log(FrameTransforms(transforms=[moved]), log_time=time_ns)
        self._poses[name].log(
            drawing.in_room(drawing.pose(seen.position_m, seen.quaternion_xyzw), time_ns), log_time=time_ns
        )
        if self._due(name, time_ns, REPEAT_NS):
            low, high = self._fleet.volume.min_m, self._fleet.volume.max_m
            entities = [
                drawing.vehicle(name, self._numbers[name], time_ns), drawing.volume(low, high, time_ns),
            ]  # fmt: skip
            self._scene.log(SceneUpdate(entities=entities), log_time=time_ns)

    def _plan(self, name: str, plan: Plan, time_ns: int) -> None:
        reference = drawing.reference(plan)
        if reference is not None:
            self._references[name].log(drawing.in_room(reference, time_ns), log_time=time_ns)
        error_m = error_of(plan)
        if error_m is not None:
            self._flight[name].log({"error_mm": 1000 * error_m}, log_time=time_ns)
        if self._due(f"{name} plan", time_ns, SCENE_NS):
            leaders = [self._places[link.leader] for link in plan.following if link.leader in self._places]
            entity = drawing.plan_entity(name, self._numbers[name], plan, leaders, time_ns)
            self._scene.log(SceneUpdate(entities=[entity]), log_time=time_ns)

    def _applied(self, name: str, applied: Applied, time_ns: int) -> None:
        sticks = dict(zip(("pitch", "roll", "thrust", "yaw"), applied.input, strict=True))
        self._sticks[name].log(sticks, log_time=time_ns)
        times = stage_times_ms(applied, partial(clock_offset, self._routers))
        if times:
            self._latency[name].log(
                {f"{stage}_ms": value for stage, value in times.items()}, log_time=time_ns
            )

    def _status(self, name: str, status: AgentStatus, time_ns: int) -> None:
        values = status.diagnostics
        figures = {"solve_ms_p99": values.solve_ms_p99, "missed_periods": values.missed_ticks}
        self._flight[name].log(figures, log_time=time_ns)

    def _router(self, host: str, status: RouterStatus, _time_ns: int) -> None:
        self._routers[host] = status
