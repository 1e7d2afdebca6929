"""Figures of each vehicle in a recorded fault flight, from its true states and its radio frames."""

from collections.abc import Mapping
from itertools import groupby, pairwise
from typing import Any, Final

import numpy as np

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.host_messages import LaboratoryVehicle
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.faults.flight_promises import NEEDED, broken_promises
from rcopterx_studies.faults.promise import SeenFlight

WATCHED: Final[tuple[Channel[Any], ...]] = (channels.LABORATORY, channels.AGENT_STATUS, *NEEDED)
"""Channels that `seen_of` and `broken_in` need."""


def seen_of(recording: Recording, places_m: Mapping[str, Three]) -> dict[str, SeenFlight]:
    """Figures of each vehicle.

    `recording`: at least the channels `WATCHED`. `places_m`: where each vehicle was at the beginning [m].
    """
    laboratory = [state for state, _ in recording.messages(channels.LABORATORY, channels.SIMULATOR_UNIT)]
    return {
        name: _seen(
            recording, name, place_m, [state.vehicles[name] for state in laboratory if name in state.vehicles]
        )
        for name, place_m in places_m.items()
    }


def broken_in(recording: Recording) -> list[str]:
    """Promises of every flight that a recording breaks, as text."""
    return [f"{vehicle}: {promise}" for _, vehicle, promise in broken_promises(recording)]


def _seen(recording: Recording, name: str, place_m: Three, truth: list[LaboratoryVehicle]) -> SeenFlight:
    applied = [message for message, _ in recording.messages(channels.APPLIED, name)]
    fresh_s = [message.written_s for message in applied if message.fresh]
    silences = [1000 * (after - before) for before, after in pairwise(fresh_s)]
    away = np.array([state.position_m for state in truth]).reshape(-1, 3) - np.array(place_m)
    touchdowns = _touchdowns(truth)
    statuses = [status for status, _ in recording.messages(channels.TRANSMITTER_STATUS, name)]
    remarks = [
        text
        for status, _ in recording.messages(channels.AGENT_STATUS, name)
        for text in status.diagnostics.remarks
    ]
    return SeenFlight(
        states=len(truth),
        deviation_mm=round(1000 * float(np.linalg.norm(away, axis=1).max(initial=0.0)), 1),
        # Of several touchdowns, as after a hop, the last one counts for the place, the hardest for the speed.
        drift_mm=round(1000 * float(np.linalg.norm(away[touchdowns[-1], :2])), 1) if touchdowns else None,
        touchdown_m_s=max((round(truth[place].touchdown_speed_m_s, 3) for place in touchdowns), default=None),
        silence_ms=round(max(silences), 1) if silences else None,
        states_of_arbiter=tuple(state for state, _ in groupby(message.state for message in applied)),
        remarks=tuple(dict.fromkeys(remarks)),
        ended=statuses[-1].state if statuses else "",
        highest_m=max((round(state.position_m[2], 3) for state in truth), default=0.0),
    )


def _touchdowns(truth: list[LaboratoryVehicle]) -> list[int]:
    """Indices of the states in which the vehicle touches the floor."""
    return [
        place
        for place, (before, after) in enumerate(pairwise(truth), 1)
        if after.touchdowns > before.touchdowns
    ]
