"""Statuses of agents that fly."""

from typing import Any

from rcopterx.bus.messages import AgentStatus, Diagnostics, LeaderLink, SetPoint


def flying_status(**changes: Any) -> AgentStatus:
    """The status of a vehicle that flies at x = y = 0, z = 1 m.

    `changes` are fields of the message or of its diagnostics.
    """
    figures: dict[str, Any] = {"controller": "paper", "estimator": "kalman", "horizon": 50}
    figures |= {name: changes.pop(name) for name in Diagnostics.__struct_fields__ if name in changes}
    fields: dict[str, Any] = {
        "phase": "flying",
        "epoch": 1,
        "frame": 1,
        "set_point": SetPoint(position_m=(0.0, 0.0, 1.0), yaw_rad=0.0),
        "diagnostics": Diagnostics(**figures),
    }
    return AgentStatus(**(fields | changes))


def hovering(position_m: tuple[float, float, float], *following: LeaderLink, **changes: Any) -> AgentStatus:
    """The status of a vehicle at its set point, heading 0, with its assigned leaders."""
    fields: dict[str, Any] = {
        "set_point": SetPoint(position_m=position_m, yaw_rad=0.0),
        "position_m": position_m,
        "yaw_rad": 0.0,
        "following": following,
        "assigned": following,
    }
    return flying_status(**(fields | changes))
