"""What goes wrong on the bus: a bad network, old messages, a sender that never stops."""

import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from msgspec.structs import replace

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.experiments.faults.bench import Bench
from rcopterx.experiments.faults.orders import give_order

FLYING_ROLES: Final = ("agent", "tracker", "transmitters")
"""Whose messages vehicles fly by."""
OLD_CHANNELS: Final[tuple[Channel[Any], ...]] = (channels.POSE, channels.COMMAND, channels.PLAN)
PERIOD_S: Final = 0.02
SEED: Final = 1
NONSENSE_BYTES: Final = 400


@dataclass(frozen=True)
class Impaired:
    """Messages of the gateways and agents are late, lost, doubled or overtaken.

    Attributes
    ----------
    how, figure
        Field of `Impairment`, and its value.
    seconds
        How long.
    """

    how: str
    figure: float
    seconds: float = 2.0

    @property
    def launched(self) -> bool:
        """See `Injector.launched`."""
        return True

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        bench.say(f"bus: {self.how} {self.figure:g} for {self.seconds:g} s")
        children = bench.supervisor.children.values()
        for number, name in enumerate(
            child.spec.name for child in children if child.spec.role in FLYING_ROLES
        ):
            give_order(
                bench.pid(name), "impair", seconds=self.seconds, seed=number, **{self.how: self.figure}
            )
        bench.wait(self.seconds)
        yield


@dataclass(frozen=True)
class OldMessages:
    """Somebody else sends old poses, commands and plans again, of this epoch and of the one before."""

    seconds: float = 2.0

    @property
    def launched(self) -> bool:
        """See `Injector.launched`."""
        return False

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        session = bench.fleet.session
        bench.say(f"bus: old messages again for {self.seconds:g} s")
        heard = [
            (channel, name, session.subscribe(channel, name, waking=False))
            for channel in OLD_CHANNELS
            for name in bench.fleet.file.vehicles
        ]
        bench.wait(0.2)
        old = [
            (channel, name, received.message)
            for channel, name, inbox in heard
            if (received := inbox.latest()) is not None
        ]
        bench.wait(1.0)

        def send() -> None:
            for channel, name, message in old:
                session.publish(channel, name, message)
                session.publish(channel, name, replace(message, epoch=max(0, message.epoch - 1)))

        _again_and_again(bench, send, PERIOD_S, self.seconds)
        yield


@dataclass(frozen=True)
class Flood:
    """Somebody sends nonsense as poses, commands and plans.

    Attributes
    ----------
    rate_hz
        Messages on each key.
    """

    rate_hz: float = 200.0
    seconds: float = 2.0

    @property
    def launched(self) -> bool:
        """See `Injector.launched`."""
        return False

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        session, chance = bench.fleet.session, random.Random(SEED)
        bench.say(
            f"bus: {self.rate_hz:g} messages of nonsense per second on every key for {self.seconds:g} s"
        )

        def send() -> None:
            for channel in OLD_CHANNELS:
                for name in bench.fleet.file.vehicles:
                    session.republish(name, channel.topic, chance.randbytes(NONSENSE_BYTES))

        _again_and_again(bench, send, 1.0 / self.rate_hz, self.seconds)
        yield


def _again_and_again(bench: Bench, send: Callable[[], None], period_s: float, seconds: float) -> None:
    """Send at a rate as long as the time lasts."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        send()
        bench.wait(period_s)
