"""Places of followers beside their leaders, and offsets from dragged handles."""

from collections.abc import Sequence

import msgspec
import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.topology import station
from rcopterx.vehicles.state import three, turned_about_z


def place_beside(
    link: LeaderLink, leader_m: Sequence[float], leader_yaw_rad: float
) -> tuple[float, float, float]:
    """Place of a follower in the inertial frame [m]."""
    return three(station([link], [np.array([*leader_m, leader_yaw_rad])])[:3])


def link_to(
    link: LeaderLink, place_m: Sequence[float], leader_m: Sequence[float], leader_yaw_rad: float
) -> LeaderLink:
    """Link that puts its follower at a place [m]; the inverse of `place_beside`."""
    away = np.array(place_m, dtype=float) - np.array(leader_m, dtype=float)
    x, y, z = turned_about_z(away, -leader_yaw_rad if link.frame == "heading" else 0.0)
    offset_m = (round(float(x), 3), round(float(y), 3), round(float(z), 3))
    return msgspec.structs.replace(link, offset_m=offset_m)
