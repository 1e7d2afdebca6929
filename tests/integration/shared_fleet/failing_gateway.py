"""The transmitter gateway of a fleet with a fault in it: `python failing_gateway.py FLEET_FILE`.

After SIGUSR2 the next command for the vehicle h2 ends in an exception.
"""

import signal
import sys
from collections.abc import Callable
from pathlib import Path

from rcopterx.deploy.roles.run import run_role
from rcopterx.fleet.reading import load_fleet
from rcopterx.transmitter_gateway.transmitter_node import TransmitterNode

FAULT = "a fault on request"


def break_on_request() -> None:
    """Replace the method of the running module that takes commands."""
    requests: list[int] = []
    take_commands = TransmitterNode.take_commands

    def take_commands_or_fail(station: TransmitterNode, clock: Callable[[], float]) -> None:
        if requests and station.vehicle == "h2":
            raise RuntimeError(FAULT)
        take_commands(station, clock)

    TransmitterNode.take_commands = take_commands_or_fail  # type: ignore[assignment, method-assign]  # that is the fault
    signal.signal(signal.SIGUSR2, lambda number, _: requests.append(number))


if __name__ == "__main__":
    break_on_request()
    run_role("transmitters", "transmitters", load_fleet(Path(sys.argv[1])))
