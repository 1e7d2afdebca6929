"""Whether vehicles are where they shall be, by what their agents say, and in words what is missing."""

import math
from typing import Final

from rcopterx.ground_station.scripting.state import VehicleState

OFFSET_TOLERANCE_M: Final = 0.001
YAW_TOLERANCE_RAD: Final = 0.2


def out_of_place(state: VehicleState, tolerance_m: float) -> str:
    """What keeps a follower from being in formation; empty if nothing does."""
    agent, error_m = state.agent, state.error_m
    if not state.assigned:
        return f"{state.name}: follows nobody"
    if agent is None or error_m is None or not agent.following:
        return f"{state.name}: {state.phase}, does not follow now"
    present = {link.leader: link.offset_m for link in agent.following}
    for link in state.assigned:
        if link.leader not in present:
            return f"{state.name}: does not follow {link.leader} now"
        if math.dist(link.offset_m, present[link.leader]) > OFFSET_TOLERANCE_M:
            return f"{state.name}: still on its way to its new offset"
    if error_m > tolerance_m:
        return f"{state.name}: {1000 * error_m:.0f} mm from its place"
    return ""


def away(state: VehicleState, tolerance_m: float) -> str:
    """How far a vehicle is from its set point; empty if it is there."""
    agent = state.agent
    if agent is None or agent.position_m is None or agent.yaw_rad is None or state.phase != "flying":
        return f"{state.name}: {state.phase}"
    distance_m = math.dist(agent.position_m, agent.set_point.position_m)
    turn_rad = abs(agent.yaw_rad - agent.set_point.yaw_rad)
    if distance_m > tolerance_m:
        return f"{state.name}: {1000 * distance_m:.0f} mm from its set point"
    if turn_rad > YAW_TOLERANCE_RAD:
        return f"{state.name}: {math.degrees(turn_rad):.0f} deg from its heading"
    return ""
