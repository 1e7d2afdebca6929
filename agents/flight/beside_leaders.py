"""References of a vehicle that follows: beside the plans of its leaders."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from rcopterx.agents.flight.task import FollowedLeader, LeaderPlan
from rcopterx.agents.formation.law import combined_reference, follower_reference
from rcopterx.control.references.trajectory import Trajectory, on_turn_of
from rcopterx.vehicles.state import YAW


class References(NamedTuple):
    """References of one control period."""

    flown: Trajectory  # what the vehicle flies
    nominal: Trajectory  # the same without disturbances above: set points of the head with all offsets


def beside_leaders(
    links: Sequence[FollowedLeader],
    plans: Mapping[str, LeaderPlan],
    deviation_share: float,
    yaw_rad: float,
    time_s: float,
    delay_s: float,
    period_s: float,
    stages: int,
) -> References:
    """Return references beside leaders, `stages` from `time_s + delay_s` on, next to the heading `yaw_rad`.

    `deviation_share` is the copied share of the leaders' deviations from their nominal references.
    """
    weights = [link.weight for link in links]

    def beside(leaders: Iterable[Trajectory], yaw_rad: float) -> Trajectory:
        references = []
        for link, leader in zip(links, leaders, strict=True):
            course, ahead_s = link.course(time_s + delay_s), plans[link.leader].ahead_s + delay_s
            reference = follower_reference(leader, course, ahead_s, period_s, stages)
            references.append(on_turn_of(reference, yaw_rad))
        return combined_reference(references, weights)

    flown = beside((plans[link.leader].partly_undisturbed(deviation_share) for link in links), yaw_rad)
    undisturbed = (plans[link.leader].undisturbed() for link in links)
    return References(flown, beside(undisturbed, float(flown.samples[0, YAW])))
