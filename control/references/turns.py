"""Whole turns of headings: vehicles count their own, and differences of full turns have no meaning."""

import math

from rcopterx.control.references.trajectory import YAW, Trajectory


def whole_turns(difference_rad: float) -> int:
    """Return the number of whole turns in a difference of headings, so that at most half a turn remains."""
    return round(difference_rad / math.tau)


def nearest_heading(yaw_rad: float, near_rad: float) -> float:
    """Return the same heading with the turns that bring it closest to another one."""
    return yaw_rad + math.tau * whole_turns(near_rad - yaw_rad)


def on_turn_of(reference: Trajectory, yaw_rad: float) -> Trajectory:
    """Return the trajectory with the turns that bring its first heading closest to another one."""
    turns = whole_turns(yaw_rad - float(reference.samples[0, YAW]))
    if turns == 0:
        return reference
    samples = reference.samples.copy()
    samples[:, YAW] += math.tau * turns
    return Trajectory(samples, reference.period_s)
