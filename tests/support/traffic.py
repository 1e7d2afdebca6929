"""What a large fleet says on its bus, without the fleet: messages of the reference flight."""

import os
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
from rcopterx.control.references.trajectory import COLUMNS
from rcopterx.flights.mcap_reading import messages_of

FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"
HORIZON, PERIOD_S = 50, 0.02
STATUS_PERIODS = 10
"""Statuses come five times a second."""


class Traffic(threading.Thread):
    """Vehicles `h1`, `h2` and so on, with plans over fifty stages.

    Parameters
    ----------
    session
        Publishes.
    vehicles
        How many.
    control
        Channels on which every vehicle speaks in every control period.
    statuses
        What it says five times a second, by channel.
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
                self._speak(self._control, name, self.sent + 7 * number)
                if (self.sent + number) % STATUS_PERIODS == 0:
                    self._speak(self._statuses, name, self.sent // STATUS_PERIODS + 7 * number)
            self.sent += 1
            self.last_s = time.monotonic()

    def _speak(self, said: Mapping[Channel[Any], Sequence[Message]], name: str, number: int) -> None:
        for channel, messages in said.items():
            self._session.publish(channel, name, messages[number % len(messages)])

    def end(self) -> None:
        """Be silent."""
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


def processor_s(process_id: int) -> float:
    """Processor time that a process has used so far."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
