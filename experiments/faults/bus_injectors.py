"""Faults of the bus: a bad network, old messages, a flood of random bytes."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from msgspec.structs import replace

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.experiments.faults.bench import Bench, PassingFault
from rcopterx.experiments.faults.orders import give_order

FLYING_ROLES: Final = ("agent", "tracker", "transmitters")  # roles whose messages control the vehicles
OLD_CHANNELS: Final[tuple[Channel[Any], ...]] = (channels.POSE, channels.COMMAND, channels.PLAN)
PERIOD_S: Final = 0.02
SEED: Final = 1
NONSENSE_BYTES: Final = 400


@dataclass(frozen=True)
class Impaired(PassingFault):
    """Messages of the gateways and agents are delayed, lost, doubled or reordered.

    `how` and `figure` are a field of `Impairment` and its value.
    """

    how: str
    figure: float
    seconds: float = 2.0

    def _happen(self, bench: Bench) -> None:
        bench.say(f"bus: {self.how} {self.figure:g} for {self.seconds:g} s")
        children = bench.supervisor.children.values()
        for number, name in enumerate(
            child.spec.name for child in children if child.spec.role in FLYING_ROLES
        ):
            give_order(
                bench.pid(name),
                "impair",
                seconds=bench.real_s(self.seconds),
                speed=bench.fleet.file.clock.speed,
                seed=number,
                **{self.how: self.figure},
            )
        bench.wait(self.seconds)


@dataclass(frozen=True)
class OldMessages(PassingFault):
    """Old poses, commands and plans are sent again, with this epoch and the one before."""

    launched = False
    seconds: float = 2.0

    def _happen(self, bench: Bench) -> None:
        session = bench.fleet.session
        bench.say(f"bus: old messages again for {self.seconds:g} s")
        inboxes = [
            (channel, name, session.subscribe(channel, name, waking=False))
            for channel in OLD_CHANNELS
            for name in bench.fleet.file.vehicles
        ]
        bench.wait(0.2)
        old = [
            (channel, name, received.message)
            for channel, name, inbox in inboxes
            if (received := inbox.latest()) is not None
        ]
        bench.wait(1.0)

        def send() -> None:
            for channel, name, message in old:
                session.publish(channel, name, message)
                session.publish(channel, name, replace(message, epoch=max(0, message.epoch - 1)))

        _repeat(bench, send, PERIOD_S, self.seconds)


@dataclass(frozen=True)
class Flood(PassingFault):
    """Random bytes are sent as poses, commands and plans, at a rate on each key."""

    launched = False
    rate_hz: float = 200.0
    seconds: float = 2.0

    def _happen(self, bench: Bench) -> None:
        session, chance = bench.fleet.session, random.Random(SEED)
        bench.say(
            f"bus: {self.rate_hz:g} messages of random bytes per second on every key for {self.seconds:g} s"
        )

        def send() -> None:
            for channel in OLD_CHANNELS:
                for name in bench.fleet.file.vehicles:
                    session.republish(name, channel.topic, chance.randbytes(NONSENSE_BYTES))

        _repeat(bench, send, 1.0 / self.rate_hz, self.seconds)


def _repeat(bench: Bench, send: Callable[[], None], period_s: float, seconds: float) -> None:
    """Send periodically for a time."""
    clock = bench.fleet.session.clock
    until_s = clock() + seconds
    while clock() < until_s:
        send()
        bench.wait(period_s)
