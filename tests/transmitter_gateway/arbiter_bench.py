"""An arbiter with a virtual clock, poses and commands at 50 Hz."""

from collections.abc import Sequence
from typing import Any

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    Action,
    ActionRequest,
    Answer,
    ArbiterOutput,
    CommandInput,
    Input,
    LinkState,
    PoseInput,
    Position,
    State,
)

U_HOVER = 0.55
SLEW: Input = (20.0, 20.0, 4.0, 8.0)
PERIOD_S = 0.02
IDLE: Input = (0.0, 0.0, 0.0, 0.0)
HOVER: Input = (0.1, -0.1, 0.55, 0.05)
PLAN = tuple((0.0, 0.0, 0.5 + 0.01 * n, 0.0) for n in range(1, 9))
EDGE_S = 0.0005
"""A moment before and after a limit, so that rounding decides no test."""


class Bench:
    def __init__(
        self, limits: ArbiterLimits | None = None, start_s: float = 1000.0, u_hover: float = U_HOVER
    ) -> None:
        self.arbiter = Arbiter("h1", limits or ArbiterLimits(), u_hover, SLEW)
        self.arbiter.link(LinkState.READY)
        self.now_s = start_s
        self.lease = self.arbiter.bid(1, start_s, take_over=False)
        self.frame = 0
        self.sequence = 0
        self.position: Position | None = (0.0, 0.0, 0.6)
        self.yaw_rad: float | None = None
        """Without it the vehicle is brought down open loop."""
        self.epoch = 7
        self.outputs: list[ArbiterOutput] = []

    @property
    def state(self) -> State:
        return self.arbiter.state

    @property
    def reason(self) -> str:
        return self.arbiter.reason

    def wait(self, seconds: float) -> ArbiterOutput:
        self.now_s += seconds
        self.outputs.append(self.arbiter.step(self.now_s))
        return self.outputs[-1]

    def pose(self, vehicle: str = "h1", position: Position | None = None) -> None:
        place = position or self.position
        self.arbiter.pose(
            PoseInput(vehicle, self.epoch, self.frame, place, PERIOD_S, self.yaw_rad), self.now_s
        )

    def command(self, u: Sequence[float] = HOVER, **changes: Any) -> Answer:
        self.sequence += 1
        fields: dict[str, Any] = {
            "lease": self.lease,
            "epoch": self.epoch,
            "sequence": self.sequence,
            "frame": self.frame,
            "u": u,
            "next_u": (),
            "period_s": PERIOD_S,
        }
        answer = self.arbiter.command(CommandInput(**{**fields, **changes}), self.now_s)
        self.outputs.append(self.arbiter.step(self.now_s))
        return answer

    def request(self, action: Action, by: str = "operator") -> Answer:
        return self.arbiter.request(ActionRequest(action, by), self.now_s)

    def run(self, seconds: float, u: Sequence[float] | None = HOVER, **changes: Any) -> ArbiterOutput:
        """Poses and, unless `u` is None, commands for `seconds`."""
        for _ in range(round(seconds / PERIOD_S)):
            self.wait(PERIOD_S)
            self.frame += 1
            self.pose()
            if u is not None:
                self.command(u, **changes)
        return self.arbiter.step(self.now_s)

    def arm(self) -> Answer:
        self.run(0.6, IDLE)
        return self.request(Action.ARM)

    def fly(self, u: Sequence[float] = HOVER) -> "Bench":
        assert self.arm().accepted
        self.run(0.6, u)
        assert self.state is State.ARMED
        return self


def flying(limits: ArbiterLimits | None = None) -> Bench:
    return Bench(limits).fly()


def silent(bench: Bench, seconds: float) -> None:
    """Poses go on, commands stop."""
    start_s = bench.now_s
    for n in range(int(seconds / 0.001)):
        if n % 20 == 0:
            bench.frame += 1
            bench.pose()
        bench.wait(0.001)
    bench.wait(start_s + seconds - bench.now_s)
