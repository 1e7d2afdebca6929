"""Whole turns of headings: each vehicle counts its own, and a full turn of difference means nothing."""

import math

from rcopterx.control.references.trajectory import YAW, Trajectory


def whole_turns(difference_rad: float) -> int:
    """Number of whole turns in a difference of two headings, so that at most half a turn remains."""
    return round(difference_rad / math.tau)


def nearest_heading(yaw_rad: float, near_rad: float) -> float:
    """The same heading, counted with the turns that bring it closest to another one."""
    return yaw_rad + math.tau * whole_turns(near_rad - yaw_rad)


def on_turn_of(reference: Trajectory, yaw_rad: float) -> Trajectory:
    """The same trajectory, its first heading counted with the turns that bring it closest to another one."""
    turns = whole_turns(yaw_rad - float(reference.samples[0, YAW]))
    if turns == 0:
        return reference
    samples = reference.samples.copy()
    samples[:, YAW] += math.tau * turns
    return Trajectory(samples, reference.period_s)
