"""Latency of commands from the capture of a frame to the radio, by stage."""

import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping
from typing import Final

from rcopterx.bus import channels
from rcopterx.bus.host_messages import RouterStatus
from rcopterx.bus.messages import Applied
from rcopterx.bus.subscription import Source
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.tables import table_beside

STAGES: Final = table_beside(__file__, "latency")
"""Extent of each stage, in order and without gaps."""
TOTAL: Final = "total"
WINDOW: Final = 500  # commands whose stages are kept for the live figures: ten seconds at 50 Hz
REFRESH_S: Final = 1.0
WAITING: Final = 256  # undecoded messages that are kept between two refreshes

ClockOffset = Callable[[str, str], float | None]  # the second host's clock minus the first's [s], if measured
Percentiles = Mapping[str, float]  # p50, p99 and max [ms]


def clock_offset(statuses: Mapping[str, RouterStatus], first: str, second: str) -> float | None:
    """Monotonic clock of the second host minus that of the first [s]; None if no router has measured it.

    `statuses` are those of the routers by host. The error is at most half the round trip between the hosts.
    """
    if first == second:
        return 0.0
    for one, other, sign in ((first, second, 1.0), (second, first, -1.0)):
        link = statuses[one].links.get(other) if one in statuses else None
        if link is not None and link.monotonic_offset_s is not None:
            return sign * link.monotonic_offset_s
    return None


def stage_times_ms(applied: Applied, offset: ClockOffset) -> dict[str, float]:
    """Time that a command spent in each stage [ms] whose clocks were compared, and their `total` if known."""
    timing, arrived_s, host = applied.timing, applied.command_arrived_s, applied.host
    if timing is None or arrived_s is None or host is None:
        return {}
    to_agent_s = offset(timing.gateway_host, timing.agent_host)
    to_gateway_s = offset(timing.agent_host, host)
    spent_s = {
        "tracker": timing.latency_s,
        "gateway": None if to_agent_s is None else timing.arrived_s - timing.received_s - to_agent_s,
        "agent": timing.began_s - timing.arrived_s,
        "solver": timing.ready_s - timing.began_s,
        "command": None if to_gateway_s is None else arrived_s - timing.ready_s - to_gateway_s,
        "radio": applied.written_s - arrived_s,
    }
    known = {stage: 1000 * seconds for stage, seconds in spent_s.items() if seconds is not None}
    if len(known) == len(STAGES):
        known[TOTAL] = sum(known.values())
    return known


def stage_figures(commands: Collection[Mapping[str, float]]) -> dict[str, Percentiles]:
    """Percentiles of the `stage_times_ms` of commands by stage, in order, the total last."""
    found = {
        stage: percentiles([times_ms[stage] for times_ms in commands if stage in times_ms])
        for stage in (*STAGES, TOTAL)
    }
    return {stage: figures for stage, figures in found.items() if figures is not None}


class LatencyWatch:
    """Latencies of a running fleet; thread-safe. `offset` gives the present offsets between clocks."""

    def __init__(self, source: Source, offset: ClockOffset) -> None:
        self._applied = source.subscribe_all(channels.APPLIED, depth=WAITING, waking=False)
        self._clock = source.clock
        self._offset = offset
        self._lock = threading.Lock()
        self._windows: dict[str, deque[dict[str, float]]] = {}
        self._figures: dict[str, tuple[float, dict[str, Percentiles]]] = {}

    def figures(self, vehicle: str) -> dict[str, Percentiles]:
        """Percentiles of the stages of a vehicle's newest commands, renewed once a second."""
        with self._lock:
            now_s = self._clock()
            computed_s, figures = self._figures.get(vehicle, (-REFRESH_S, {}))
            if now_s - computed_s >= REFRESH_S:
                figures = self._renewed(vehicle)
                self._figures[vehicle] = now_s, figures
            return figures

    def _renewed(self, vehicle: str) -> dict[str, Percentiles]:
        if (inbox := self._applied.inboxes.get(vehicle)) is None:
            return {}
        window = self._windows.setdefault(vehicle, deque(maxlen=WINDOW))
        times_ms = (stage_times_ms(received.message, self._offset) for received in inbox.drain())
        window.extend(filter(None, times_ms))
        return stage_figures(window)
