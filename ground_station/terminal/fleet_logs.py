"""Logs of the processes of a fleet on all its hosts, read from files here or over the bus."""

from collections.abc import Sequence
from typing import Final

from rcopterx.bus.requests import LoggedLine, ReadLogs, ReadLogsReply
from rcopterx.bus.session import RequestFailedError
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.hosts.running import running_fleets
from rcopterx.deploy.processes.log_reading import ProcessLogs
from rcopterx.deploy.processes.table import processes_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet

ANSWER_S: Final = 1.0  # for a host to answer, and for the first request to find it
MOST_PAGES: Final = 500  # read from one host in one call; the rest follows in the next
OTHERS: Final = ("launcher", "spare")  # processes with logs that are not in the table of a host


def hosts_here(file: FleetFile) -> set[str]:
    """Hosts of a fleet that run on this computer, whose logs lie in one directory."""
    up = (running for running in running_fleets() if running.fleet == file.name)
    return {running.host for running in up if running.namespace == file.bus.namespace} & file.hosts.keys()


class FleetLogs:
    """New lines of all hosts of a fleet, of `names` or all; without `joined` logs of this computer only."""

    def __init__(self, file: FleetFile, names: Sequence[str], joined: Fleet | None) -> None:
        self.directory = run_directory(file.name, file.bus.namespace) / "log"  # logs of this computer
        self._here = ProcessLogs(self.directory, names)
        here = hosts_here(file)
        self._label = "+".join(sorted(here)) or "here"
        self._names = tuple(names)
        self._joined = joined
        self._positions: dict[str, dict[str, int]] = {}
        self._times: dict[tuple[str, str], str] = {}
        # The only host of a fleet that is not up is this one, if any.
        alone = joined is None and len(file.hosts) == 1
        self._others = [] if alone else [host for host in file.hosts if host not in here]
        self.missing = [host for host in self._others if self._page(host, {}, ANSWER_S) is None]
        """Hosts that did not answer."""
        answering = [host for host in self._others if host not in self.missing]
        known = {spec.name for host in answering for spec in processes_of(file, host)}
        self.processes = sorted({*self._here.processes(), *known, *(OTHERS if answering else ())})
        """Names of processes that may have a log."""

    def new_lines(self) -> list[tuple[str, LoggedLine]]:
        """Lines since the last call with their hosts, in the order of their times."""
        lines = [(self._label, line) for line in self._here.new_lines()]
        for host in self._others:
            lines += [(host, line) for line in self._lines_of(host)]
        # Stable: lines of one log with the same time keep their order.
        return sorted(lines, key=lambda found: found[1].time)

    def _lines_of(self, host: str) -> list[LoggedLine]:
        found: list[LoggedLine] = []
        for _ in range(MOST_PAGES):
            if (page := self._page(host, self._positions.get(host, {}), 0.0)) is None:
                break
            self._positions[host] = page.positions
            for line in page.lines:
                time = line.time or self._times.get((host, line.process), "")
                self._times[host, line.process] = time
                found.append(LoggedLine(time, line.process, line.text))
            if not page.more:
                break
        return found

    def _page(self, host: str, positions: dict[str, int], patience_s: float) -> ReadLogsReply | None:
        if self._joined is None:
            return None
        request = ReadLogs(names=self._names, positions=positions)
        try:
            reply = self._joined.session.request(host, request, ANSWER_S, patience_s)
        except RequestFailedError:
            return None
        return reply if isinstance(reply, ReadLogsReply) else None
