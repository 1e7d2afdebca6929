"""The supervisor's side of the fork server: children that need no start-up."""

import ctypes
import errno
import json
import math
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import weakref
from _thread import start_new_thread
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO, Final

from rcopterx.bus.heartbeat import HeartbeatPage
from rcopterx.bus.realtime import ONE_THREAD, leave_realtime
from rcopterx.deploy.processes.fork_server import LARGEST_BYTES, PERMISSION, ForkAnswer, Order

SERVER: Final = "rcopterx.deploy.processes.fork_server"
PR_SET_CHILD_SUBREAPER: Final = 36
START_LIMIT_S: Final = 60.0  # for the imports of a fork server, on a busy computer
ANSWER_LIMIT_S: Final = 0.5  # then the fork server is replaced; nothing else is supervised meanwhile
URGENT_NICE: Final = -10
"""Nice value of a process that starts: a large share of a busy processor, but, unlike a real-time priority,
not all of what the launcher's threads need."""
RETRY_S: Final = 1.0  # between two starts of a fork server


def child_environment() -> dict[str, str]:
    """Return the environment of supervised processes, with one thread for each numerical library."""
    return os.environ | ONE_THREAD | {"RCOPTERX_PARENT": str(os.getpid())}


class ForkedProcess:
    """A child of this process that a fork server has started, used by any thread like `subprocess.Popen`."""

    def __init__(self, pid: int, page: HeartbeatPage, stdin: IO[bytes] | None = None) -> None:
        self.pid, self.page, self.stdin = pid, page, stdin
        self.returncode: int | None = None
        self._reaping = threading.Lock()
        try:
            self.descriptor = os.pidfd_open(pid)
        except OSError:
            # Its death would go unnoticed.
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            raise
        # Not before: a thread may still wait for the descriptor when another one reaps the process.
        weakref.finalize(self, os.close, self.descriptor)

    def poll(self) -> int | None:
        """Return the exit code, negative for a signal; None while it runs."""
        return self._reap(os.WNOHANG)

    def wait(self, timeout_s: float | None = None) -> int:
        """Wait for its end and return its exit code; raises `subprocess.TimeoutExpired`."""
        poller = select.poll()
        poller.register(self.descriptor, select.POLLIN)
        if not poller.poll(None if timeout_s is None else 1e3 * timeout_s):
            assert timeout_s is not None
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout_s)
        code = self._reap(0)
        assert code is not None
        return code

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self._signal(signal.SIGKILL)

    def leave_realtime(self) -> None:
        """Move all threads of one that does not end into the normal class, where it gets time to do so."""
        with suppress(OSError):
            leave_realtime(map(int, os.listdir(f"/proc/{self.pid}/task")))

    def _signal(self, number: signal.Signals) -> None:
        with self._reaping:
            if self.returncode is None:
                os.kill(self.pid, number)

    def _reap(self, options: int) -> int | None:
        with self._reaping:
            if self.returncode is None:
                result = os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT | options)
                if result is not None:
                    status = result.si_status
                    self.returncode = status if result.si_code == os.CLD_EXITED else -status
                    # `Thread.start` would wait until the thread runs, which has no real-time priority.
                    start_new_thread(_remove, (self.pid,))
            return self.returncode


class ForkServer:
    """Starts processes; itself a process, started when first needed and when it has ended.

    It imports `modules` once. `priority` is its own, 0 for none: vehicles may wait for a process.
    `speed` is that of the time of the fleet, in which it has to answer.
    """

    def __init__(
        self,
        modules: Sequence[str] = (),
        priority: int = 0,
        clock: Callable[[], float] = time.monotonic,
        *,
        speed: float = 1.0,
    ) -> None:
        self._words = (str(priority), ",".join(modules))
        self._speed, self._clock = speed, clock
        self._pilots: tuple[str, ...] = ()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket | None = None
        self._start_s = -math.inf
        self._ready = False
        self._patience_s = START_LIMIT_S

    @property
    def pid(self) -> int | None:
        """Its process id; None while there is none."""
        return None if self._process is None else self._process.pid

    def ensure_running(self) -> bool:
        """Start it if it does not run, not too often; return whether it is a successor, or `OSError`."""
        if self._process is not None and self._process.poll() is None:
            return False
        if self._clock() - self._start_s < RETRY_S:
            return False
        again = self._start_s > -math.inf
        self.close()
        self._start_s = self._clock()
        # This process becomes the parent of what the fork server starts and leaves behind.
        if ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1) != 0:
            raise OSError(ctypes.get_errno(), "this process cannot adopt what a fork server starts")
        own, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with other, ExitStack() as stack:
            stack.callback(own.close)
            self._process = subprocess.Popen(
                [sys.executable, "-m", SERVER, str(other.fileno()), *self._words, *self._pilots],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                pass_fds=[other.fileno()],
                env=child_environment(),
            )
            stack.pop_all()
        self._connection = own
        return again

    def start(self, command: Sequence[str], log: Path, *, piped: bool = False) -> ForkedProcess:
        """Start a supervised process, before other programs if that is permitted.

        `command`: command line. A module of this interpreter (`python -m MODULE ...`) runs in the forked
        process; any other program is executed there. `log`: file its output is appended to. `piped`: whether
        its standard input is a pipe. Raises `OSError`: no descriptors are left, or no fork server is ready.
        """
        self.ensure_running()
        self._wait_until_ready()
        with ExitStack() as inherited, ExitStack() as own:
            page = HeartbeatPage()
            inherited.callback(page.handed_over)
            output = inherited.enter_context(log.open("ab"))
            stdin, writing = os.pipe() if piped else (os.open(os.devnull, os.O_RDONLY), None)
            inherited.callback(os.close, stdin)
            pipe = None if writing is None else own.enter_context(os.fdopen(writing, "wb"))
            permission, permit = os.pipe()
            inherited.callback(os.close, permission)
            inherited.callback(os.close, permit)
            order: Order = {"command": list(command), "environment": child_environment()}
            self._send(order, [stdin, output.fileno(), page.descriptor, permission])
            pid = self._answer(ANSWER_LIMIT_S / self._speed)["pid"]
            process = ForkedProcess(pid, page, pipe)
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, pid, URGENT_NICE)
            os.write(permit, PERMISSION)
            own.pop_all()
        return process

    def prepare_pilots(self, snapshot: Path, host: str, vehicles: Sequence[str]) -> None:
        """Let it build pilots, which takes time, before vehicles fly; may raise `OSError`."""
        if not vehicles:
            return
        self.ensure_running()
        self._wait_until_ready()
        pilots = (str(snapshot), host, *vehicles)
        self._send({"prepare": list(pilots)})
        self._answer(START_LIMIT_S)
        self._pilots = pilots

    def _wait_until_ready(self) -> None:
        """Wait for the first fork server only: vehicles may fly when a later one starts."""
        if not self._ready:
            self._answer(self._patience_s)
            self._ready, self._patience_s = True, 0.0

    def _send(self, order: Order, descriptors: Sequence[int] = ()) -> None:
        assert self._connection is not None
        try:
            socket.send_fds(self._connection, [json.dumps(order).encode()], descriptors)
        except ConnectionError:
            raise OSError(errno.ECHILD, "the fork server has ended") from None

    def _answer(self, limit_s: float) -> ForkAnswer:
        """Return the next answer; `OSError` if it is an error, or the server ended, is not ready or hangs."""
        if self._connection is None:
            raise OSError(errno.EAGAIN, "the fork server has ended, its successor is started soon")
        self._connection.settimeout(limit_s)
        try:
            message = self._connection.recv(LARGEST_BYTES)
        except BlockingIOError:
            raise OSError(errno.EAGAIN, "the fork server is not ready yet") from None
        except (TimeoutError, ConnectionError):
            message = b""
        if not message:
            self.close()
            raise OSError(errno.ECHILD, "the fork server has ended or does not answer")
        answer: ForkAnswer = json.loads(message)
        if "error" in answer:
            raise OSError(errno.EAGAIN, answer["error"])
        return answer

    def close(self) -> None:
        """End it; the processes it has started run on."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        self._ready = False


def _remove(pid: int) -> None:
    """Remove an ended process in a thread without real-time priority: the kernel may spin for a second."""
    leave_realtime()
    os.waitpid(pid, 0)
