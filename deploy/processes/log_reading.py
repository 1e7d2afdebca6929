"""Reads the logs of the processes of a fleet, sorted by time."""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

from rcopterx.bus.requests import MAX_LINE, MAX_LINES, LoggedLine, ReadLogs, ReadLogsReply
from rcopterx.deploy.processes.process_log import OLDER, SUFFIX

PAGE_BYTES: Final = 16_000  # all logs in one answer; undecodable bytes take three times their size
_STAMP: Final = re.compile(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z ")


class ProcessLogs:
    """The logs in a directory, of `names` or all; `positions` are the bytes of each file read before."""

    def __init__(
        self, directory: Path, names: Iterable[str] = (), positions: Mapping[str, int] | None = None
    ) -> None:
        self._directory, self._names = directory, set(names)
        self.positions = dict(positions or {})  # number of bytes of each file that have been read
        self._times: dict[Path, str] = {}

    def processes(self) -> list[str]:
        """Return the names of the processes that have a log."""
        return sorted({path.name.partition(SUFFIX)[0] for path in self._directory.glob(f"*{SUFFIX}*")})

    def new_lines(self) -> list[LoggedLine]:
        """Return all unread lines, sorted by time; lines without one have that of the line before."""
        lines = [line for path in self._files() for line in self._lines_of(path)]
        # Stable: lines of one log with the same time keep their order.
        return sorted(lines, key=lambda line: line.time)

    def page(self) -> tuple[list[LoggedLine], bool]:
        """Return some lines that were not read before, log by log, and whether there are more."""
        lines: list[LoggedLine] = []
        room_bytes = PAGE_BYTES
        for path in self._files():
            known = self.positions.get(path.name, 0)
            lines += self._lines_of(path, room_bytes, MAX_LINES - len(lines))
            room_bytes -= max(0, self.positions.get(path.name, 0) - known)
            if room_bytes <= PAGE_BYTES // 2 or len(lines) >= MAX_LINES // 2:
                return lines, True
        return lines, False

    def _files(self) -> list[Path]:
        """Logs to be read, older ones first."""
        found = sorted(self._directory.glob(f"*{SUFFIX}*"), key=lambda path: path.suffix != OLDER)
        found = [path for path in found if self._wanted(path)]
        for path in found:
            if path.suffix != OLDER and _size(path) < self.positions.get(path.name, 0):
                # Its content has moved to the older log, perhaps with lines that were not read.
                self.positions[path.name + OLDER] = self.positions.pop(path.name)
        return found

    def _wanted(self, path: Path) -> bool:
        process = path.name.partition(SUFFIX)[0]
        return not self._names or process in self._names or process.removeprefix("agent-") in self._names

    def _lines_of(
        self, path: Path, most_bytes: int = -1, most_lines: int | None = None
    ) -> Iterator[LoggedLine]:
        process = path.name.partition(SUFFIX)[0]
        try:
            with path.open("rb") as file:
                start = self.positions.get(path.name, 0)
                file.seek(start)
                data = file.read(most_bytes)
        except OSError:
            return
        *whole, rest = data.split(b"\n")
        if not whole and len(rest) == most_bytes:
            whole = [rest]  # A line that does not fit into an answer is split.
        whole = whole[:most_lines]
        self.positions[path.name] = start + min(sum(len(line) + 1 for line in whole), len(data))
        for line in whole:
            text = line.decode(errors="replace").rstrip("\r")
            if (stamp := _STAMP.match(text)) is not None:
                self._times[path] = stamp[0].strip()
            yield LoggedLine(self._times.get(path, ""), process, text[stamp.end() :] if stamp else text)


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def read_page(directory: Path, request: ReadLogs) -> ReadLogsReply:
    """Answer a request for the logs of the processes of this host."""
    logs = ProcessLogs(directory, request.names, request.positions)
    lines, more = logs.page()
    return ReadLogsReply(
        accepted=True,
        lines=tuple(LoggedLine(line.time, line.process, line.text[:MAX_LINE]) for line in lines),
        positions=logs.positions,
        more=more,
    )
