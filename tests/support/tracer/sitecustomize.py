"""Traces the loops of a fleet's processes: calls that can block, and garbage that they leave.

With this directory in PYTHONPATH every interpreter imports this file. `RCOPTERX_TRACE` names the file that
findings are appended to, one JSON object a line. A loop begins with its first heartbeat: what its thread does
from then on is traced, until the last one; then a garbage collection shows what the loop left behind.
"""

import gc
import json
import os
import sys
from collections import Counter
from collections.abc import Callable
from threading import get_ident
from types import FrameType, FunctionType
from typing import Any, Final

from setproctitle import getproctitle

SHOWN: Final = 12
WATCHED: Final = ("open", "import", "subprocess.Popen", "ctypes.dlopen", "glob.glob", "webbrowser.open")
PREFIXES: Final = ("os.", "shutil.", "tempfile.", "socket.get")
ADDRESSED: Final = ("socket.bind", "socket.connect", "socket.sendto")
HARMLESS: Final = ("os.kill", "os.putenv", "os.unsetenv")
UNAUDITED: Final = ("fsync", "fdatasync", "stat", "lstat", "access", "readlink")


class Tracer:
    """Findings of this process, in the threads that have loops."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._loops: set[int] = set()
        self._found: set[str] = set()

    def begin(self) -> None:
        """Trace the calling thread from now on."""
        if get_ident() not in self._loops:
            gc.collect()
            gc.freeze()
            self._loops.add(get_ident())
            self.note("loop", "")

    def end(self) -> None:
        """Trace the calling thread no more, and note the garbage of a process that does not collect it."""
        if get_ident() not in self._loops:
            return
        self._loops.discard(get_ident())
        if not gc.isenabled():
            gc.set_debug(gc.DEBUG_SAVEALL)
            gc.collect()
            gc.set_debug(0)
            kinds = Counter(_kind(item) for item in _without_types(gc.garbage))
            gc.garbage.clear()
            self.note("garbage", f"{kinds.total()}: {kinds.most_common(SHOWN)}" if kinds else "")

    def hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        """See `sys.addaudithook`."""
        if get_ident() not in self._loops:
            return
        if event in ADDRESSED:
            address = arguments[1]
            if isinstance(address, tuple) and not str(address[0]).replace(".", "").isdecimal() and address[0]:
                self.note(event, str(address))
        elif (event in WATCHED or event.startswith(PREFIXES)) and event not in HARMLESS:
            self.note(event, str(arguments)[:200])

    def note(self, event: str, what: str) -> None:
        """Append a finding, each once."""
        finding = {"event": event, "what": what, "process": getproctitle().split()[1:3], "where": _where()}
        line = json.dumps(finding)
        if line not in self._found:
            self._found.add(line)
            os.write(self._descriptor, f"{line}\n".encode())

    def watched(self, name: str) -> Callable[..., Any]:
        """Return a function of `os` that is noted in loops."""
        function = getattr(os, name)

        def call(*arguments: Any, **options: Any) -> Any:
            if get_ident() in self._loops:
                self.note(f"os.{name}", str(arguments)[:200])
            return function(*arguments, **options)

        return call


class Stream:
    """Standard output or error; what a loop writes there is noted."""

    def __init__(self, stream: Any, name: str, tracer: Tracer) -> None:
        self._stream, self._name, self._tracer = stream, name, tracer

    def write(self, text: str) -> Any:
        if get_ident() in self._tracer._loops:
            self._tracer.note(f"write to {self._name}", text[:200])
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _without_types(garbage: list[Any]) -> list[Any]:
    """Leave out what msgspec leaves once for a type that it converts to for the first time."""
    described = [
        item for item in garbage if isinstance(item, FunctionType) and item.__module__ == "msgspec._utils"
    ]
    left_out = {id(item) for item in described}
    for item in described:
        left_out |= {id(item.__closure__), *map(id, item.__closure__ or ())}
    return [item for item in garbage if id(item) not in left_out]


def _kind(item: object) -> str:
    """Return the type of an object; the name of a function, which is what a recursive one is found by."""
    return (
        f"function {item.__module__}.{item.__qualname__}"
        if isinstance(item, FunctionType)
        else type(item).__name__
    )


def _where() -> list[str]:
    """Return the innermost lines of the project, the innermost first."""
    frame: FrameType | None = sys._getframe(2)
    lines = []
    while frame is not None and len(lines) < SHOWN:
        path = frame.f_code.co_filename
        if "rcopterx" in path and "sitecustomize" not in path:
            lines.append(f"{path.rpartition('rcopterx/')[2]}:{frame.f_lineno}")
        frame = frame.f_back
    return lines


def trace_processes(path: str) -> Tracer:
    """Trace the loops of this process."""
    tracer = Tracer(os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600))
    from rcopterx.bus.heartbeat import Heartbeat

    beat, starting, ending = Heartbeat.beat, Heartbeat.starting, Heartbeat.ending

    def traced_beat(self: Heartbeat, flying: bool = False) -> None:
        beat(self, flying)
        tracer.begin()

    def traced_starting(self: Heartbeat) -> None:
        tracer.end()
        starting(self)

    def traced_ending(self: Heartbeat) -> None:
        tracer.end()
        ending(self)

    Heartbeat.beat = traced_beat  # type: ignore[method-assign]
    Heartbeat.starting = traced_starting  # type: ignore[method-assign]
    Heartbeat.ending = traced_ending  # type: ignore[method-assign]
    sys.addaudithook(tracer.hook)
    for name in UNAUDITED:
        setattr(os, name, tracer.watched(name))
    return tracer


if "RCOPTERX_TRACE" in os.environ and __name__ == "sitecustomize":
    _tracer = trace_processes(os.environ["RCOPTERX_TRACE"])
    sys.stdout = Stream(sys.stdout, "standard output", _tracer)
    sys.stderr = Stream(sys.stderr, "standard error", _tracer)
