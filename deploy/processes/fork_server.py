"""Starts the processes of a host by forking.

Starting an interpreter and importing numerical libraries takes longer than a vehicle can wait, and every
process that does so keeps its own copy. This process imports once, has a single thread, and forks on order;
what it has imported and prepared is shared memory of all of them. A forked process is handed to the
supervisor as its own child: the intermediate process that forked it ends at once, and the supervisor adopts
orphans.

Orders are datagrams in JSON over a Unix socket. One that starts a process comes with four descriptors:
standard input, log, heartbeat page, and a pipe on which the forked process waits for permission. It is
answered by a process id or an error. The supervisor gives permission when it knows the process; one that
nobody knows ends. The other kind of order names a fleet to prepare.
"""

import errno
import gc
import importlib
import json
import os
import runpy
import socket
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, TypedDict

from rcopterx.bus.heartbeat import VARIABLE
from rcopterx.bus.realtime import leave_realtime, request_realtime
from rcopterx.deploy.roles.run import name_process

LARGEST_BYTES: Final = 1 << 20
"""Room for a datagram, more than the kernel passes at once."""
DESCRIPTORS: Final = 4
PERMISSION: Final = b"!"
PID_BYTES: Final = 4
PREPARE: Final = "--prepare"
"""On the command line: snapshot, host and vehicles follow, as in an order."""


class Order(TypedDict, total=False):
    """What to start, a command line and the environment it runs in; or the arguments of `prepare`."""

    command: list[str]
    environment: dict[str, str]
    prepare: list[str]


class Answer(TypedDict, total=False):
    """Which process runs now, or why none does; empty when a fleet is prepared."""

    pid: int
    error: str


def main() -> None:
    """Entry point: arguments DESCRIPTOR PRIORITY MODULE... [--prepare WORD...].

    Imports the modules, prepares the fleet if one is named, tells that orders may come, and forks until the
    supervisor closes its end.
    """
    descriptor, priority, *modules = sys.argv[1:]
    words: list[str] = []
    if PREPARE in modules:
        position = modules.index(PREPARE)
        modules, words = modules[:position], modules[position + 1 :]
    name_process("fork server")
    for module in modules:
        importlib.import_module(module)
    problem = _prepare(words) if words else ""
    if problem:
        print(f"fork server: prepares nothing: {problem}", file=sys.stderr)
    _freeze()
    request_realtime(int(priority))
    connection = socket.socket(fileno=int(descriptor))
    connection.send(_told({"pid": os.getpid()}))
    run = serve(connection, int(priority))
    if run is not None:
        run()


def _freeze() -> None:
    """Exclude all objects from garbage collection, which would write to pages that forks share."""
    gc.collect()
    gc.freeze()


def _prepare(words: Sequence[str]) -> str:
    """Prepare a fleet; what is wrong with it, if anything.

    Whatever that is, processes start all the same: they prepare for themselves and tell what they find.
    """
    from rcopterx.deploy.processes.preloading import prepare

    snapshot, host, *vehicles = words
    try:
        prepare(Path(snapshot), host, vehicles)
    except Exception as error:  # noqa: BLE001 - nothing that a pilot does may end the fork server
        return str(error) or type(error).__name__
    return ""


def serve(connection: socket.socket, priority: int = 0) -> Callable[[], None] | None:
    """Fork on every order to start something.

    Parameters
    ----------
    connection
        To the supervisor.
    priority
        That of this process, which it leaves while it prepares: vehicles of others may fly.

    Returns
    -------
    callable or None
        In a forked process what it shall do, with an empty call stack below; None in the server itself, after
        the other end was closed.
    """
    while True:
        message, descriptors, _, _ = socket.recv_fds(connection, LARGEST_BYTES, DESCRIPTORS)
        if not message:
            return None
        order: Order = json.loads(message)
        if "prepare" in order:
            leave_realtime()
            problem = _prepare(order["prepare"])
            _freeze()
            request_realtime(priority)
            connection.send(_told({"error": problem} if problem else {}))
            continue
        try:
            pid = _forked()
        except OSError as error:
            connection.send(_told({"error": str(error)}))
        else:
            if pid is None:
                connection.close()
                return _begin(order, descriptors)
            connection.send(_told({"pid": pid}))
        for descriptor in descriptors:
            os.close(descriptor)


def _told(answer: Answer) -> bytes:
    return json.dumps(answer).encode()


def _forked() -> int | None:
    """Process id of a forked process that is no child of this one; None in that process.

    Raises
    ------
    OSError
        There are no processes or descriptors left.
    """
    reading, writing = os.pipe()
    try:
        intermediate = os.fork()
        if intermediate == 0:
            _fork_and_end(writing)
            os.close(reading)
            return None
    finally:
        os.close(writing)
    with os.fdopen(reading, "rb") as answers:
        answer = answers.read()
    os.waitpid(intermediate, 0)
    if len(answer) != PID_BYTES:
        raise OSError(errno.EAGAIN, "no more processes can be started")
    return int.from_bytes(answer, "little")


def _fork_and_end(writing: int) -> None:
    """Of the intermediate process: returns only in its child.

    The server waits for the intermediate process, which therefore is in its real-time class: where other
    programs want the processor all the time, it would otherwise answer too late. Its child is ordinary.
    """
    try:
        child = os.fork()
    except OSError:
        os._exit(1)
    if child != 0:
        os.write(writing, child.to_bytes(PID_BYTES, "little"))
        os._exit(0)
    leave_realtime()


def _begin(order: Order, descriptors: Sequence[int]) -> Callable[[], None]:
    """Make a forked process what it would be if it had been started by its command line."""
    standard_input, log, page, permission = descriptors
    if os.read(permission, len(PERMISSION)) != PERMISSION:
        os._exit(0)
    os.close(permission)
    os.setsid()
    os.dup2(standard_input, 0)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.close(standard_input)
    os.close(log)
    os.environ.clear()
    os.environ.update(order["environment"] | {VARIABLE: str(page)})
    command = order["command"]
    if command[:2] != [sys.executable, "-m"]:
        os.set_inheritable(page, True)
        return lambda: os.execvp(command[0], command)
    module = command[2]
    sys.argv = command[2:]
    return lambda: _run_module(module)


def _run_module(module: str) -> None:
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
