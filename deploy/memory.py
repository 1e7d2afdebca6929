"""The launcher remembers what each agent last said, for its successor after a restart."""

import threading

from bus import channels
from bus.requests import Recall, RecallReply
from bus.session import BusAddress, Session


class Memory:
    """Answers `recall` for the vehicles of a host in a thread of its own.

    Parameters
    ----------
    address
        The bus.
    vehicles
        Vehicles whose agents run on this host.
    """

    def __init__(self, address: BusAddress, vehicles: list[str]) -> None:
        self._wake = threading.Event()
        self._stopping = False
        self._session = Session(address, wake=self._wake.set)
        self._statuses = {
            vehicle: self._session.subscribe(channels.AGENT_STATUS, vehicle) for vehicle in vehicles
        }
        for vehicle in vehicles:
            self._session.serve(vehicle, ["recall"])
        self._thread = threading.Thread(target=self._run, name="memory", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping:
            self._wake.wait(0.5)
            self._wake.clear()
            for incoming in self._session.pending():
                if isinstance(incoming.request, Recall):
                    incoming.answer(self._recall(incoming.unit))

    def _recall(self, vehicle: str) -> RecallReply:
        received = self._statuses[vehicle].latest()
        if received is None:
            return RecallReply(accepted=False, reason=f"{vehicle} has not said anything yet")
        age_s = max(0.0, self._session.clock() - received.arrived_s)
        return RecallReply(accepted=True, status=received.message, age_s=age_s)

    def close(self) -> None:
        """Forget."""
        self._stopping = True
        self._wake.set()
        self._thread.join()
        self._session.close()
