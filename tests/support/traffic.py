"""Traffic of a large fleet, from messages of the reference flight."""

import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import decode
from rcopterx.bus.message import Message
from rcopterx.bus.messages import AgentStatus, Plan
from rcopterx.bus.session import Session
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.control.references.columns import COLUMNS
from rcopterx.flights.mcap_reading import messages_of

FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"
HORIZON, PERIOD_S = 50, 0.02
STATUS_PERIODS = 10
"""Statuses come five times a second."""


class Traffic(threading.Thread):
    """Vehicles `h1`, `h2` and so on, with plans over fifty stages.

    They publish on the channels `control` in every control period, and `statuses` five times a second.
    """

    def __init__(
        self,
        session: Session,
        vehicles: int,
        control: Sequence[Channel[Any]],
        statuses: Mapping[Channel[Any], Sequence[Message]] = MappingProxyType({}),
    ) -> None:
        super().__init__(daemon=True)
        self.names = [f"h{number + 1}" for number in range(vehicles)]
        self._session = session
        self._control = {channel: flown(channel) for channel in control}
        self._statuses = statuses
        self._end = threading.Event()
        self.sent = 0
        self.last_s = 0.0

    def run(self) -> None:
        due_s = time.monotonic()
        while not self._end.wait(max(0.0, due_s - time.monotonic())):
            due_s += PERIOD_S
            for number, name in enumerate(self.names):
                self._publish(self._control, name, self.sent + 7 * number)
                if (self.sent + number) % STATUS_PERIODS == 0:
                    self._publish(self._statuses, name, self.sent // STATUS_PERIODS + 7 * number)
            self.sent += 1
            self.last_s = time.monotonic()

    def _publish(self, messages_of: Mapping[Channel[Any], Sequence[Message]], name: str, number: int) -> None:
        for channel, messages in messages_of.items():
            self._session.publish(channel, name, messages[number % len(messages)])

    def end(self) -> None:
        """Stop."""
        self._end.set()
        self.join()


def flown(channel: Channel[Any]) -> list[Message]:
    """Messages of the reference flight; its plans are made longer, its statuses are those in the air."""
    topic = f"h1/{channel.topic}"
    found = [decode(m.payload, channel.message) for m in messages_of(FLIGHT) if m.topic == topic]
    found = [m for m in found if not isinstance(m, AgentStatus) or m.phase == "flying"]
    assert found, topic
    return [_longer(m, seed) if isinstance(m, Plan) else m for seed, m in enumerate(found)]


def _longer(plan: Plan, seed: int) -> Plan:
    values = np.zeros((HORIZON, COLUMNS))
    rates = np.cumsum(np.random.default_rng(seed).normal(scale=0.01, size=(HORIZON, 4)), axis=0)
    values[:, 4:8] = rates
    values[:, :4] = np.cumsum(PERIOD_S * rates, axis=0)
    trajectory = TrajectoryArray.of(values)
    fields = {name: getattr(plan, name) for name in Plan.__struct_fields__}
    return Plan(**(fields | {"trajectory": trajectory, "period_s": PERIOD_S}))
