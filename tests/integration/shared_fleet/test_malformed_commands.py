"""Malformed commands in great number are counted and do not disturb the flight."""

import time
from collections.abc import Iterator

import numpy as np
import pytest
from integration_support import Flying, Truth, fly_to

from rcopterx.bus import channels
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import Command
from rcopterx.bus.session import Session
from rcopterx.deploy.roles.addresses import bus_address

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

BURST, BURST_PERIOD_S = 50, 0.01


@pytest.mark.parametrize("count", [10_000, pytest.param(100_000, marks=pytest.mark.campaign)])
def test_thousands_of_malformed_commands_are_counted_and_do_not_disturb(
    flying: Flying, truth: Truth, count: int
) -> None:
    before = refused_commands(flying, "h2")
    with Session(bus_address(flying.fleet.file, "main")) as stranger:
        pauses = paced(BURST_PERIOD_S)
        for number in range(count):
            stranger.publish(channels.COMMAND, "h2", bad_command(number))
            if number % BURST == 0:
                next(pauses)
    # On a busy machine the bus may drop some; nothing that arrives goes uncounted.
    flying.fleet.wait_until(
        lambda: refused_commands(flying, "h2") - before > 0.8 * count, 30, "rejections are not counted"
    )
    fly_to(flying, truth, (0.2, 0.1, 0.9))
    truth.assert_none_touched_down()


def paced(period_s: float) -> Iterator[None]:
    """Wait for the next tick of a period."""
    next_s = time.monotonic()
    while True:
        next_s += period_s
        time.sleep(max(0.0, next_s - time.monotonic()))
        yield


def bad_command(number: int) -> Command:
    lease, thrust, sequence = (
        (10**15, 0.5, 10**15),
        (1, 7.0, 10**15),
        (1, float("nan"), 10**15),
        (1, 0.5, 0),
    )[number % 4]
    return Command(
        epoch=1, frame=number, lease=lease, sequence=sequence, input=(0.0, 0.0, thrust, 0.0),
        next_inputs=FloatArray.of(np.zeros((0, 4))), period_s=0.02,
    )  # fmt: skip


def refused_commands(flying: Flying, name: str) -> int:
    """Commands refused by the arbiter, not decodable, or pushed out before anybody read them."""
    status = flying.fleet.state_of(name).transmitter
    if status is None:
        return 0
    kinds = (
        "no such control lease",
        "control lease lost",
        "old sequence number",
        "command out of limits",
        "older epoch",
        "epoch not in the raw poses",
    )
    return sum(status.counters.get(kind, 0) for kind in kinds) + sum(status.rejected.values())
