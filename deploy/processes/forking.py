"""The supervisor's side of the fork server: processes of its own that need no start-up."""

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
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO, Final, NamedTuple

from rcopterx.bus.heartbeat import HeartbeatPage
from rcopterx.bus.realtime import ONE_THREAD
from rcopterx.deploy.processes.fork_server import LARGEST_BYTES, PERMISSION, PREPARE, Answer, Order

SERVER: Final = "rcopterx.deploy.processes.fork_server"
PR_SET_CHILD_SUBREAPER: Final = 36
START_LIMIT_S: Final = 60.0
"""Until a fork server has imported what it shall; a busy machine takes its time."""
ANSWER_LIMIT_S: Final = 0.5
"""A fork server that does not answer for so long is replaced. Nothing else is supervised meanwhile."""
URGENT_NICE: Final = -10
"""Of a process that starts. On a busy computer it gets its share of the processor ten times over, and the
threads that launch it get theirs all the same, as they would not beside a real-time process."""
RETRY_S: Final = 1.0
"""From one start of a fork server to the next."""


def child_environment() -> dict[str, str]:
    """Environment of supervised processes: one thread per numerical library, and who the parent is."""
    return os.environ | {
        **ONE_THREAD,
        "RCOPTERX_PARENT": str(os.getpid()),
    }


class ForkedProcess:
    """A child of this process that a fork server has started; used like `subprocess.Popen`.

    Parameters
    ----------
    pid
        Its process id.
    stdin
        Writing end of its standard input, if that is a pipe.

    Raises
    ------
    OSError
        No descriptor is left to watch it; it was ended.
    """

    def __init__(self, pid: int, stdin: IO[bytes] | None = None) -> None:
        self.pid = pid
        self.stdin = stdin
        self.returncode: int | None = None
        try:
            self.descriptor = os.pidfd_open(pid)
        except OSError:
            # Nobody would notice its death.
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            raise

    def poll(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        return self._reaped(os.WNOHANG)

    def wait(self, timeout_s: float | None = None) -> int:
        """Wait for its end.

        Raises
        ------
        subprocess.TimeoutExpired
            It still runs.
        """
        if timeout_s is not None and self.returncode is None:
            poller = select.poll()
            poller.register(self.descriptor, select.POLLIN)
            if not poller.poll(1e3 * timeout_s):
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout_s)
        code = self._reaped(0)
        assert code is not None
        return code

    def terminate(self) -> None:
        """Ask it to end."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self._signal(signal.SIGKILL)

    def _signal(self, number: signal.Signals) -> None:
        if self.returncode is None:
            os.kill(self.pid, number)

    def _reaped(self, options: int) -> int | None:
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, options)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
                os.close(self.descriptor)
        return self.returncode


class Started(NamedTuple):
    """A process and the page it beats into."""

    process: ForkedProcess
    page: HeartbeatPage


class ForkServer:
    """Starts processes; itself a process, started when it is first needed and again when it has ended.

    Parameters
    ----------
    modules
        Imported once, for all processes it forks.
    priority
        SCHED_FIFO priority of the fork server itself, 0 for none: orders come while vehicles wait.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self,
        modules: Sequence[str] = (),
        priority: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._words = (str(priority), *modules)
        self._prepared: tuple[str, ...] = ()
        self._clock = clock
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket | None = None
        self._start_s = -math.inf
        self._ready = False
        self._patience_s = START_LIMIT_S

    @property
    def pid(self) -> int | None:
        """Its process id, None while there is none."""
        return None if self._process is None else self._process.pid

    def prepare(self) -> bool:
        """Begin to start it, unless it runs or was started a moment ago; returns whether it is another one.

        Raises
        ------
        OSError
            It cannot be started.
        """
        if self._process is not None and self._process.poll() is None:
            return False
        if self._clock() - self._start_s < RETRY_S:
            return False
        again = self._start_s > -math.inf
        self.close()
        self._start_s = self._clock()
        _adopt_orphans()
        own, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with other, ExitStack() as stack:
            stack.callback(own.close)
            self._process = subprocess.Popen(
                [sys.executable, "-m", SERVER, str(other.fileno()), *self._words, *self._prepared],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                pass_fds=[other.fileno()],
                env=child_environment(),
            )
            stack.pop_all()
        self._connection = own
        return again

    def start(self, command: Sequence[str], log: Path, *, piped: bool = False) -> Started:
        """Start a supervised process with a heartbeat, before other programs if that is permitted.

        Parameters
        ----------
        command
            Command line. A module of this interpreter (`python -m MODULE ...`) runs in the forked process;
            any other program is executed there.
        log
            File its output is appended to.
        piped
            Whether its standard input is a pipe; empty otherwise.

        Raises
        ------
        OSError
            It cannot be started, for instance for want of descriptors, or because the fork server has
            just ended and its successor is not ready.
        """
        self.prepare()
        self._wait_until_ready()
        with ExitStack() as handed_over, ExitStack() as own:
            page = HeartbeatPage()
            handed_over.callback(page.handed_over)
            output = handed_over.enter_context(log.open("ab"))
            stdin, writing = _standard_input(piped)
            handed_over.callback(os.close, stdin)
            pipe = None if writing is None else own.enter_context(os.fdopen(writing, "wb"))
            permission, permit = os.pipe()
            handed_over.callback(os.close, permission)
            handed_over.callback(os.close, permit)
            pid = self._ordered(command, [stdin, output.fileno(), page.descriptor, permission])
            process = ForkedProcess(pid, pipe)
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, pid, URGENT_NICE)
            os.write(permit, PERMISSION)
            own.pop_all()
        return Started(process, page)

    def prepare_fleet(self, snapshot: Path, host: str, vehicles: Sequence[str]) -> None:
        """Have it read a fleet and build pilots before it forks their agents, now and when it starts again.

        Parameters
        ----------
        snapshot, host, vehicles
            See `deploy.preloading.prepare`.

        Raises
        ------
        OSError
            It cannot; processes that it forks do so themselves.
        """
        self.prepare()
        self._wait_until_ready()
        words = (str(snapshot), host, *vehicles)
        self._send({"prepare": list(words)}, [])
        # Nothing of this host is in the air yet.
        answer = self._answer(START_LIMIT_S)
        if "error" in answer:
            raise OSError(errno.EINVAL, answer["error"])
        self._prepared = (PREPARE, *words)

    def _wait_until_ready(self) -> None:
        """Only the first one is waited for: vehicles may fly when a later one starts."""
        if not self._ready:
            self._answer(self._patience_s)
            self._ready, self._patience_s = True, 0.0

    def _ordered(self, command: Sequence[str], descriptors: Sequence[int]) -> int:
        self._send({"command": list(command), "environment": child_environment()}, descriptors)
        answer = self._answer(ANSWER_LIMIT_S)
        if "error" in answer:
            raise OSError(errno.EAGAIN, answer["error"])
        return answer["pid"]

    def _send(self, order: Order, descriptors: Sequence[int]) -> None:
        assert self._connection is not None
        try:
            socket.send_fds(self._connection, [json.dumps(order).encode()], descriptors)
        except ConnectionError:
            raise OSError(errno.ECHILD, "the fork server has ended") from None

    def _answer(self, limit_s: float) -> Answer:
        """The next answer.

        Raises
        ------
        OSError
            It has ended; it is not ready yet; it does not answer, and was ended.
        """
        if self._connection is None:
            raise OSError(errno.EAGAIN, "the fork server has ended, another one is started soon")
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
        answer: Answer = json.loads(message)
        return answer

    def close(self) -> None:
        """End it; what it has started runs on."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        self._ready = False


def _standard_input(piped: bool) -> tuple[int, int | None]:
    """Descriptor to read from, and the one to write into if there is one."""
    if piped:
        return os.pipe()
    return os.open(os.devnull, os.O_RDONLY), None


def _adopt_orphans() -> None:
    """Become the parent of processes whose parent has ended, if it descends from this one."""
    if ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1) != 0:
        raise OSError(ctypes.get_errno(), "this process cannot adopt what a fork server starts")
