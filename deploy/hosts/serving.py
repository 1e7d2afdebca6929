"""A service of a launcher: answers requests in a thread of its own, which takes turns in lockstep."""

import threading
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Self

from rcopterx.bus.session import BusAddress, Session


class Service(ABC):
    """A session that is served by `serve`, or in a thread of its own from `start` on."""

    def __init__(self, address: BusAddress, name: str, timeout_s: float = 5.0) -> None:
        self._stopping = False
        address = replace(address, process=name)
        self._session = Session(address, timeout_s=timeout_s, begin=False, interrupted=lambda: self._stopping)
        self._thread = threading.Thread(target=self.serve, name=name, daemon=True)

    def start(self) -> Self:
        """Begin to serve."""
        self._thread.start()
        return self

    def serve(self) -> None:
        """Answer requests until it is stopped."""
        self._session.begin()
        while not self._stopping:
            self._session.wait(max(0.0, self._due_s() - self._session.clock()))
            self._step()

    @abstractmethod
    def _due_s(self) -> float:
        """Return when there is something to do without a message [s]."""

    @abstractmethod
    def _step(self) -> None:
        """Answer requests, and do what is due."""

    def stop(self) -> None:
        """Answer no more requests."""
        self._stopping = True
        self._session.wake()
        if self._thread.is_alive():
            self._thread.join()

    def close(self) -> None:
        """Leave the bus."""
        self.stop()
        self._session.close()
