"""Whether a vehicle may still be in the air after a silence of its radio."""

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import FLYING, LastApplied, Track


def take_over_problem(
    last: LastApplied, track: Track | None, limits: ArbiterLimits, now_s: float
) -> str | None:
    """Why a vehicle with this last output and this track is not taken over, None if it is.

    The silence is that of an earlier process of this gateway, or of a port that was away. A vehicle that is
    not seen yet is taken over: its rotor turns by the last frame, and a pose may be late. Low thrust in the
    last frame is no reason against it; only low thrust that lasted for `arm_low_s` is (`grounded`).
    """
    if last.state not in FLYING:
        return f"{last.state} before"
    if now_s >= last.written_s + limits.take_over_s:
        return f"no frames for {now_s - last.written_s:.2f} s, longer than {limits.take_over_s:g} s"
    if last.grounded:
        return "it stood on the floor"
    if seen_on_floor(track, limits):
        return "it may stand on the floor"
    return None


def seen_on_floor(track: Track | None, limits: ArbiterLimits) -> bool:
    """Whether a vehicle is seen where it may stand on the floor."""
    if track is None or track.position_m is None:
        return False
    return track.position_m[2] < limits.floor_m + limits.airborne_m
