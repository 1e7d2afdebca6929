"""Reads the logs of the processes of a fleet, merged in time."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from rcopterx.deploy.process_log import OLDER, SUFFIX

_STAMP: Final = re.compile(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z ")


class LogLine(NamedTuple):
    """A line of a log; it sorts by its time.

    Attributes
    ----------
    time
        As it is written, UTC; that of the line before for lines without one, for instance of a traceback.
    process
        Whose it is.
    text
        The line without its time.
    """

    time: str
    process: str
    text: str


class ProcessLogs:
    """The logs in a directory.

    Parameters
    ----------
    directory
        Where they lie.
    names
        Processes or vehicles whose logs are read; none for all.
    """

    def __init__(self, directory: Path, names: Iterable[str] = ()) -> None:
        self._directory = directory
        self._names = set(names)
        self._read_bytes: dict[Path, int] = {}
        self._times: dict[Path, str] = {}

    def processes(self) -> list[str]:
        """Names of the processes that have a log."""
        return sorted({path.name.partition(SUFFIX)[0] for path in self._directory.glob(f"*{SUFFIX}*")})

    def new_lines(self) -> list[LogLine]:
        """Lines that were not read before, in the order of their times."""
        lines = [
            line
            for path in sorted(self._directory.glob(f"*{SUFFIX}*"), key=lambda path: path.suffix != OLDER)
            if self._wanted(path)
            for line in self._lines_of(path)
        ]
        # Stable: lines of one log with the same time keep their order.
        return sorted(lines, key=lambda line: line.time)

    def _wanted(self, path: Path) -> bool:
        process = path.name.partition(SUFFIX)[0]
        return not self._names or process in self._names or process.removeprefix("agent-") in self._names

    def _lines_of(self, path: Path) -> Iterator[LogLine]:
        process = path.name.partition(SUFFIX)[0]
        try:
            with path.open("rb") as file:
                start = self._read_bytes.get(path, 0)
                # A log that is shorter than before was put aside, and this is its successor.
                file.seek(start if path.stat().st_size >= start else 0)
                data = file.read()
                whole = data[: data.rfind(b"\n") + 1]
                self._read_bytes[path] = file.tell() - len(data) + len(whole)
        except OSError:
            return
        for text in whole.decode(errors="replace").splitlines():
            stamp = _STAMP.match(text)
            if stamp is not None:
                self._times[path] = stamp[0].strip()
            yield LogLine(self._times.get(path, ""), process, text[stamp.end() :] if stamp else text)
