"""Plans as messages, and subscriptions without a bus."""

from collections.abc import Callable

import numpy as np

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import LeaderLink, Plan
from rcopterx.bus.subscription import Inbox
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.control.references.columns import COLUMNS


class PlanInbox(Inbox[Plan]):
    """A subscription to a plan that tests fill by hand."""

    def __init__(self, name: str) -> None:
        super().__init__(channels.PLAN)
        self.name = name
        self.closed = False

    def close(self) -> None:
        self.closed = True

    def arrive(self, plan: Plan, arrived_s: float = 100.0) -> None:
        self.store(encode(plan), arrived_s)


class PlanBus:
    """Hands out subscriptions and delivers plans to them."""

    def __init__(self) -> None:
        self.opened: list[PlanInbox] = []
        self.delivered: Callable[[], None] = lambda: None
        """What reads the plans after a delivery, as at the beginning of a step."""

    def subscribe(self, name: str) -> PlanInbox:
        self.opened.append(PlanInbox(name))
        return self.opened[-1]

    def deliver(self, plan: Plan, arrived_s: float = 100.0) -> None:
        for inbox in self.opened:
            if inbox.name == plan.source and not inbox.closed:
                inbox.arrive(plan, arrived_s)
        self.delivered()

    def open_names(self) -> list[str]:
        return sorted(inbox.name for inbox in self.opened if not inbox.closed)


def plan_of(
    source: str,
    frame: int = 10,
    *,
    epoch: int = 1,
    ancestors: tuple[str, ...] = (),
    start_s: float = 0.02,
    position_m: tuple[float, float, float] = (0.0, 0.0, 1.0),
    airborne: bool = True,
    followable: bool = True,
    yaw_rad: float = 0.0,
    reference_m: tuple[float, float, float] | None = None,
    following: tuple[LeaderLink, ...] = (),
    nominal_stages: int = 0,
) -> Plan:
    """Plan of a vehicle that hovers."""
    samples = np.zeros((20, COLUMNS))
    samples[:, :3] = position_m
    samples[:, 3] = yaw_rad
    return Plan(
        epoch=epoch,
        frame=frame,
        source=source,
        ancestors=ancestors,
        period_s=0.02,
        start_s=start_s,
        airborne=airborne,
        followable=followable,
        trajectory=TrajectoryArray.of(samples),
        reference=None if reference_m is None else (*reference_m, yaw_rad),
        following=following,
        nominal=TrajectoryArray.of(np.zeros((nominal_stages, COLUMNS))) if nominal_stages else None,
    )
