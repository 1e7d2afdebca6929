"""Checks that a router routes: messages that its process sends through it to itself come back."""

import select
from typing import Final

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.endpoints import Credentials, client_config, open_session
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.bus.keys import probe_key

CONTENT: Final = b"probe"
"""`rcopterx doctor` sends messages without content on the same key."""
PERIOD_S: Final = LONGEST_WAIT_S
OPENING_LIMIT_S: Final = 10.0
"""Longest wait until the router accepts its own process."""


class Probe:
    """Sends messages through a router from one session to another; nothing is routed back to its sender."""

    def __init__(self, sender: zenoh.Session, receiver: zenoh.Session, key: str) -> None:
        self._received = 0
        self._seen = 0
        self._publisher = sender.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.REAL_TIME
        )
        self._subscriber = receiver.declare_subscriber(key, Callback(self._on_message, indirect=False))

    def _on_message(self, _: zenoh.Sample) -> None:
        self._received += 1

    def send(self) -> None:
        """Send a message; never blocks."""
        self._publisher.put(CONTENT)

    def came_back(self) -> bool:
        """Return whether a message has arrived since the last call."""
        seen, self._seen = self._seen, self._received
        return self._seen != seen


def probe_until(
    ended: int,
    endpoint: str,
    namespace: str | None,
    fleet: str,
    host: str,
    credentials: Credentials | None = None,
) -> None:
    """Beat as long as the router of this process routes, until the descriptor `ended` becomes readable."""
    config = client_config([endpoint], namespace, OPENING_LIMIT_S, credentials)
    sender, receiver = (open_session(config) for _ in range(2))
    with sender, receiver:
        probe, heartbeat = Probe(sender, receiver, probe_key(fleet, host)), own_heartbeat()
        while not select.select([ended], [], [], PERIOD_S)[0]:
            if probe.came_back():
                heartbeat.beat()
            probe.send()
        heartbeat.ending()
