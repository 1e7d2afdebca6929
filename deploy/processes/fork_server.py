"""The fork server of a host: starts the host's processes by forking.

Starting an interpreter and importing numerical libraries takes longer than a vehicle can wait. The fork
server imports once, and forks on order; forked processes share what it has prepared. It forks twice and ends
the process between, so that the supervisor, which adopts orphans, becomes the parent.

Orders and answers are JSON datagrams over a Unix socket. An order that starts a process comes with four
descriptors: standard input, log, heartbeat page, and a pipe on which the forked process waits for permission.
The supervisor gives it once it knows the process id; else the process ends. Others name a fleet to prepare.
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

LARGEST_BYTES: Final = 1 << 20  # size of the receive buffer: more than the kernel passes in a datagram
DESCRIPTORS: Final = 4
PERMISSION: Final = b"!"
PID_BYTES: Final = 4


class Order(TypedDict, total=False):
    """A command line and its environment; or snapshot, host and vehicles of the pilots to prepare."""

    command: list[str]
    environment: dict[str, str]
    prepare: list[str]


class ForkAnswer(TypedDict, total=False):
    """Process id of the process that was started, or an error; empty when pilots are prepared."""

    pid: int
    error: str


def main() -> None:
    """Entry point: DESCRIPTOR PRIORITY MODULE,MODULE,... [SNAPSHOT HOST VEHICLE...].

    Imports the modules, prepares the pilots, and serves until the supervisor closes its end of the socket.
    """
    descriptor, priority, modules, *pilots = sys.argv[1:]
    name_process("fork server")
    for module in filter(None, modules.split(",")):
        importlib.import_module(module)
    problem = _prepare(pilots) if pilots else ""
    if problem:
        print(f"fork server: prepares nothing: {problem}", file=sys.stderr)
    _freeze()
    request_realtime(int(priority))
    connection = socket.socket(fileno=int(descriptor))
    _answer(connection, {"pid": os.getpid()})
    if (run := serve(connection, int(priority))) is not None:
        run()


def serve(connection: socket.socket, priority: int) -> Callable[[], object] | None:
    """Carry out orders until the supervisor closes; in a forked process return what it shall do."""
    while True:
        message, descriptors, _, _ = socket.recv_fds(connection, LARGEST_BYTES, DESCRIPTORS)
        if not message:
            return None
        order: Order = json.loads(message)
        if "prepare" in order:
            # Vehicles of other fleets may fly meanwhile.
            leave_realtime()
            problem = _prepare(order["prepare"])
            _freeze()
            request_realtime(priority)
            _answer(connection, {"error": problem} if problem else {})
            continue
        try:
            pid = _fork_twice()
        except OSError as error:
            _answer(connection, {"error": str(error)})
        else:
            if pid is None:
                connection.close()
                return _become(order, descriptors)
            _answer(connection, {"pid": pid})
        for descriptor in descriptors:
            os.close(descriptor)


def _answer(connection: socket.socket, answer: ForkAnswer) -> None:
    connection.send(json.dumps(answer).encode())


def _freeze() -> None:
    """Exclude all objects from garbage collection, which would write to pages that forks share."""
    gc.collect()
    gc.freeze()


def _prepare(words: Sequence[str]) -> str:
    """Prepare pilots; return what is wrong, if anything: processes then build for themselves."""
    from rcopterx.deploy.roles.agent import prepare

    snapshot, host, *vehicles = words
    try:
        prepare(Path(snapshot), host, vehicles)
    except Exception as error:  # noqa: BLE001 - no error in a pilot may end the fork server
        return str(error) or type(error).__name__
    return ""


def _fork_twice() -> int | None:
    """Fork a process that is no child of this one; return its id, None in it. Raises `OSError`."""
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
    """Fork in the intermediate process, report the child's id, and end; return in the child only."""
    try:
        child = os.fork()
    except OSError:
        os._exit(1)
    if child != 0:
        os.write(writing, child.to_bytes(PID_BYTES, "little"))
        os._exit(0)
    leave_realtime()


def _become(order: Order, descriptors: Sequence[int]) -> Callable[[], object]:
    """Make a forked process what its command line would have started; return what it shall do."""
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
    sys.argv = command[2:]
    return lambda: runpy.run_module(command[2], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
