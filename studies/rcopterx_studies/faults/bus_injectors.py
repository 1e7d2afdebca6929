"""Faults of the bus: a bad network, old messages, a flood of random bytes."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from msgspec.structs import replace

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx_studies.faults.bench import Bench, PassingFault
from rcopterx_studies.faults.orders import give_order

FLYING_ROLES: Final = ("agent", "tracker", "transmitters")  # roles whose messages control the vehicles
OLD_CHANNELS: Final[tuple[Channel[Any], ...]] = (channels.POSE, channels.COMMAND, channels.PLAN)
SECONDS: Final = 2.0  # for which each fault lasts
PERIOD_S: Final = 0.02
FLOOD_HZ: Final = 200.0
SEED: Final = 1
NONSENSE_BYTES: Final = 400


@dataclass(frozen=True)
class Impaired(PassingFault):
    """Messages are delayed, lost, doubled or reordered; `how`: field of `Impairment`, `figure`: its value."""

    how: str
    figure: float

    def _happen(self, bench: Bench) -> None:
        bench.say(f"bus: {self.how} {self.figure:g} for {SECONDS:g} s")
        children = bench.supervisor.children
        names = [name for name, child in children.items() if child.spec.role in FLYING_ROLES]
        for number, name in enumerate(names):
            give_order(
                bench.pid(name),
                "impair",
                seconds=bench.real_s(SECONDS),
                speed=bench.fleet.file.clock.speed,
                seed=number,
                **{self.how: self.figure},
            )
        bench.wait(SECONDS)


class OldMessages(PassingFault):
    """Old poses, commands and plans are sent again, with this epoch and the one before."""

    launched = False

    def _happen(self, bench: Bench) -> None:
        session = bench.fleet.session
        bench.say(f"bus: old messages again for {SECONDS:g} s")
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

        _repeat(bench, send, PERIOD_S)


class Flood(PassingFault):
    """Random bytes are sent as poses, commands and plans, at a rate on each key."""

    launched = False

    def _happen(self, bench: Bench) -> None:
        session, chance = bench.fleet.session, random.Random(SEED)
        bench.say(f"bus: {FLOOD_HZ:g} messages of random bytes per second on every key for {SECONDS:g} s")

        def send() -> None:
            for channel in OLD_CHANNELS:
                for name in bench.fleet.file.vehicles:
                    session.republish(name, channel.topic, chance.randbytes(NONSENSE_BYTES))

        _repeat(bench, send, 1.0 / FLOOD_HZ)


def _repeat(bench: Bench, send: Callable[[], None], period_s: float) -> None:
    """Send periodically."""
    clock = bench.fleet.session.clock
    until_s = clock() + SECONDS
    while clock() < until_s:
        send()
        bench.wait(period_s)
