"""Starting and stopping the processes of a fleet through the daemons of its hosts."""

import time
from collections.abc import Collection
from importlib.metadata import version
from typing import Final

from rcopterx.bus.requests import IdentifyReply, Reply, Request, StartHost, StopHost
from rcopterx.bus.session import BusUnreachableError, NotServedError, RequestFailedError
from rcopterx.deploy.hosts.running import running_fleets
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.joining import check_identity

ROUTER_S: Final = 0.5  # for the router of one host to answer
LINKED_S: Final = 3.0  # for the routers of all hosts to be linked
RETRY_S: Final = 0.1
STOP_S: Final = 5.0
CLOCK_S: Final = 0.1  # larger differences of hosts' clocks are reported: logs are hard to compare


def joined_fleet(file: FleetFile) -> Fleet | None:
    """The fleet, through the router of the first host that answers, if any; raises WrongFleetError."""
    here = [running.host for running in running_fleets() if running.fleet == file.name]
    for host in dict.fromkeys((*(host for host in here if host in file.hosts), *file.hosts)):
        try:
            return Fleet(file, host, ROUTER_S)
        except BusUnreachableError:
            continue
    return None


class Daemons:
    """Starts and stops a fleet, joined through any host, through the daemons of its hosts."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._there: list[str] = []

    def find(self) -> list[str]:
        """Find the hosts of the fleet file; return a line for every one that is missing or differs."""
        wanted = self._fleet.file.hosts
        give_up_s = time.monotonic() + LINKED_S
        answers: dict[str, IdentifyReply] = {}
        while time.monotonic() < give_up_s and not wanted.keys() <= answers.keys():
            answers |= {answer.host: answer for answer in self._fleet.session.identify()}
            time.sleep(RETRY_S)
        check_identity(self._fleet.session, self._fleet.file)
        self._there = [host for host in wanted if host in answers]
        return [
            *(f"host {host} does not answer" for host in wanted if host not in answers),
            *differences(answers, version("rcopterx")),
            *self._fleet.clock_differences(CLOCK_S),
        ]

    def start(self, without: Collection[str] = ()) -> list[str]:
        """Start the processes of every host that was found; return their answers, none without daemons.

        Raises `FleetError`: a host does not start; those that were started are stopped again.
        """
        answers, request = [], StartHost(without=tuple(without))
        found, self._there = self._there, []
        for host in found:
            try:
                reply = self._request(host, request)
            except NotServedError:
                # It has no daemon: its processes belong to the program that started them.
                continue
            if not reply.accepted:
                self.stop()
                raise FleetError(f"host {host} does not start: {reply.reason}")
            self._there.append(host)
            answers.append(reply.reason)
        return answers

    def stop(self) -> list[str]:
        """End the processes of every host, but not daemons and routers; return the problems."""
        problems = []
        for host in self._there:
            try:
                reply = self._request(host, StopHost())
            except RequestFailedError as error:
                problems.append(f"host {host} does not stop: {error}")
                continue
            if not reply.accepted:
                problems.append(f"host {host} does not stop: {reply.reason}")
        return problems

    def _request(self, host: str, request: Request) -> Reply:
        return self._fleet.session.request(host, request, timeout_s=STOP_S)


def differences(answers: dict[str, IdentifyReply], own: str) -> list[str]:
    """Hosts whose software has another version than this program."""
    return [
        f"host {host} runs version {answer.version or 'unknown'}, this program is {own}"
        for host, answer in sorted(answers.items())
        if answer.version != own
    ]
