"""Promises of the emulated log of a Crazyflie: requests that are too short or unknown get no answer."""

import pytest

from rcopterx.radios.crazyflie_battery import (
    CONTROL_CHANNEL,
    CREATE_BLOCK,
    DATA_CHANNEL,
    GET_INFO,
    GET_ITEM,
    LOG,
    START_BLOCK,
    TABLE_CHANNEL,
)
from rcopterx.radios.crtp import Packet
from rcopterx.simulator.crazyflie import NO_SUCH, TABLE, CrazyflieLog


@pytest.mark.parametrize(
    ("channel", "data"),
    [
        (TABLE_CHANNEL, (GET_ITEM, 0)),
        (CONTROL_CHANNEL, (CREATE_BLOCK, 1)),
        (CONTROL_CHANNEL, (START_BLOCK,)),
        (CONTROL_CHANNEL, ()),
        (DATA_CHANNEL, (GET_INFO, 0, 0)),
    ],
)
def test_a_short_or_unknown_request_gets_no_answer(channel: int, data: tuple[int, ...]) -> None:
    assert CrazyflieLog().obey(Packet(LOG, channel, bytes(data)), 0.0) is None


def test_a_block_of_a_variable_that_does_not_exist_is_refused() -> None:
    log = CrazyflieLog()
    for request in ((CREATE_BLOCK, 1, 7, len(TABLE), 0), (START_BLOCK, 1, 10)):
        answer = log.obey(Packet(LOG, CONTROL_CHANNEL, bytes(request)), 0.0)
        assert answer is not None
        assert answer.data == bytes((*request[:2], NO_SUCH))
    assert log.due(1.0, 0.0) == []
