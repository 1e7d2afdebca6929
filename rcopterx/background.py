"""Work that can block for seconds, as looking up names can, beside a loop that must not wait for it."""

import socket
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from threading import Thread
from typing import TypeVar

T = TypeVar("T")
Start = Callable[[Callable[[], None]], None]
Address = tuple[str, int]


def in_thread(work: Callable[[], None]) -> None:
    """Run `work` in a thread of its own, which does not keep the process from ending."""
    Thread(target=work, name="background", daemon=True).start()


def at_once(work: Callable[[], None]) -> None:
    """Run `work` now: in lockstep no time passes meanwhile."""
    work()


def begin(start: Start, work: Callable[[], T]) -> Future[T]:
    """Have `start` run `work`; return its future result. `RuntimeError`: no further thread is allowed."""
    result: Future[T] = Future()
    start(partial(_complete, result, work))
    return result


def _complete(result: Future[T], work: Callable[[], T]) -> None:
    try:
        result.set_result(work())
    except Exception as error:  # noqa: BLE001 - it is raised where the result is read
        # Tracebacks lead to the result: cycles, which a loop without garbage collection would keep.
        error.__traceback__ = error.__context__ = None
        result.set_exception(error)


def look_up(host: str, port: int) -> Address:
    """Return the address of a host name; raises `OSError`. It may block."""
    try:
        return str(socket.getaddrinfo(host, port, socket.AF_INET)[0][4][0]), port
    except UnicodeError as error:  # a label of the name is empty or too long
        raise OSError(f"{host!r} is no host name: {error}") from None
