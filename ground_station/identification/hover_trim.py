"""Mean inputs of a hover, from the inputs written to the radio, to trim a transmitter."""

from collections.abc import Sequence

import numpy as np

from rcopterx.bus import channels
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.vehicles.state import four

STEADY = 0.02  # mean input below which a vehicle counts as trimmed
MOST_SPREAD = 0.2
FEWEST_PER_S = 20


class HoverError(RuntimeError):
    """There was no steady hover to measure."""


def measured_hover(observer: Observer, vehicle: str, seconds: float) -> tuple[float, float, float, float]:
    """Mean applied inputs of a vehicle that hovers now, over some seconds; raises HoverError."""
    observer.wait_for_status([vehicle])
    if observer.state_of(vehicle).phase != "flying":
        raise HoverError(f"hover first; it is {observer.state_of(vehicle).phase}")
    recorder = FlightSampler(observer.session, only=(channels.APPLIED,))
    recorder.start()
    observer.wait(seconds)
    applied = [message for message, _ in recorder.stop().messages(channels.APPLIED, vehicle)]
    return mean_of_hover([one.state for one in applied], [one.input for one in applied], seconds)


def mean_of_hover(
    states: Sequence[str], inputs: Sequence[Sequence[float]], seconds: float
) -> tuple[float, float, float, float]:
    """Mean of applied inputs, shape (n, 4); `HoverError` if they are few, not all armed, or drift."""
    if len(inputs) < FEWEST_PER_S * seconds:
        raise HoverError(f"only {len(inputs)} frames in {seconds:g} s")
    if others := sorted(set(states) - {"armed"}):
        raise HoverError(f"the arbiter was {', '.join(others)} meanwhile")
    values = np.array(inputs)
    half = len(values) // 2
    drift = float(np.abs(values[:half].mean(axis=0) - values[half:].mean(axis=0)).max())
    if drift > MOST_SPREAD:
        raise HoverError(f"no steady hover: the mean inputs changed by {drift:.2f} meanwhile")
    return four(values.mean(axis=0))
