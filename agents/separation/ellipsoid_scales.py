"""Size of the ellipsoid that separates a vehicle from each other one, by their formation.

Every vehicle computes it from the statuses of all. Vehicles of different formations both avoid each other;
the side on which they pass is chosen in `rcopterx.control.controllers.cascade.clearance`.
"""

from collections.abc import Mapping
from typing import Final

from rcopterx.agents.formation.topology import FormationGraph, ancestors, roots
from rcopterx.agents.separation.avoidance import SeparationEllipsoid
from rcopterx.vehicles.state import Array

FORMATION_SCALE: Final = 0.9
"""Fraction of the distance of two places in a formation that its vehicles keep."""


def ellipsoid_scale(
    ellipsoid: SeparationEllipsoid, links: FormationGraph, places: Mapping[str, Array], name: str, other: str
) -> float:
    """Return the scale, 0 to 1, of the ellipsoid that a vehicle keeps free of another one.

    It is 0 for its followers, whose plans are made from its own. Vehicles of one formation keep at most
    `FORMATION_SCALE` of the distance of their `places` (x, y, z first), which an operator has chosen.
    """
    if name in ancestors(links, other):
        return 0.0
    mates = set(roots(links, name)) & set(roots(links, other))
    if not mates or name not in places or other not in places:
        return 1.0
    gap_m = places[name][:3] - places[other][:3]
    return min(1.0, FORMATION_SCALE * float(ellipsoid.normalised(gap_m)))
