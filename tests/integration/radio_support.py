"""Radios of a flying fleet: what reached their modules, what these report, and the death of their gateway."""

import math

from integration_support import NAMES, Flying, counter, flown_by

from rcopterx.bus import channels


class RadioLog:
    """Frames that reached the radio modules, with the time of their arrival."""

    def __init__(self, flying: Flying) -> None:
        self._inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=4096)
        self._frames: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}

    def frames(self, name: str) -> list[tuple[float, float]]:
        """Arrival time [s] and throttle [us] of all frames so far."""
        for received in self._inbox.drain():
            for unit, vehicle in received.message.vehicles.items():
                self._frames[unit] += [(frame[0], frame[1]) for frame in vehicle.radio]
        return self._frames[name]

    def throttles(self, name: str, from_s: float, until_s: float = math.inf) -> list[float]:
        """Pulse widths [us] in a time [monotonic s]."""
        return [throttle for at_s, throttle in self.frames(name) if from_s <= at_s < until_s]


def module(flying: Flying, name: str) -> str:
    """What the radio module of a vehicle reports, empty before its first report."""
    status = flying.fleet.state_of(name).transmitter
    return "" if status is None else status.module


def kill_gateway_in_flight(flying: Flying) -> None:
    """Kill the transmitter gateway and wait until its successor flies all vehicles."""
    flying.wait_for_spare("transmitters")
    started_s = flying.started_s("transmitters")
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: (
            flying.started_s("transmitters") > started_s
            and all(counter(flying, name, "openings") == 1 and flown_by(flying, name) for name in NAMES)
        ),
        30,
        "not taken over",
        NAMES,
    )
