"""Requests in lockstep, from one process that takes turns to another."""

from collections.abc import Sequence
from functools import partial
from typing import Final

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.turns import Turns

LONG_S: Final = 600.0
"""Longest wait in real time for what always comes."""


def request_in_turns(
    session: zenoh.Session, turns: Turns, key: str, payload: bytes, timeout_s: float
) -> Sequence[zenoh.Reply]:
    """Send a request, and take turns until the reply counts; return none after the time-out."""
    replies: list[zenoh.Reply] = []

    def answered(reply: zenoh.Reply, _: zenoh.Sample | None = None) -> None:
        replies.append(reply)
        turns.wake()

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is None:
            answered(reply)
        else:
            turns.replies.hold(partial(answered, reply), reply.ok)

    session.get(
        key, Callback(on_reply, indirect=False), payload=payload, attachment=turns.stamp(key), timeout=LONG_S
    )
    give_up_s = turns.page.now() + timeout_s
    while not replies and turns.page.now() < give_up_s:
        turns.wait(give_up_s - turns.page.now())
    return replies
