"""Takes steps on a host by the ssh client of the system, with the user's own keys and settings."""

import subprocess
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from rcopterx.deploy.remote.plan import Login, Step

OPTIONS: Final = ("-o", "BatchMode=yes", "-o", "ConnectTimeout=10")
"""Nobody is there to type a password; keys and agents do without."""
UNREACHABLE: Final = 255
"""Exit code of ssh itself."""


class RemoteError(RuntimeError):
    """A host cannot be reached, or a command on it failed; says which, and what it said."""


Run = Callable[[str, bytes], "subprocess.CompletedProcess[bytes]"]
"""Runs a shell command with a standard input."""


def on(target: str) -> Run:
    """Runs commands on a host.

    Parameters
    ----------
    target
        What is given to ssh: `lab@192.168.0.11`, or a name of its configuration.
    """

    def run(command: str, content: bytes) -> "subprocess.CompletedProcess[bytes]":
        done = subprocess.run(
            ["ssh", *OPTIONS, target, command], input=content, capture_output=True, check=False
        )
        if done.returncode == UNREACHABLE:
            raise RemoteError(f"{target}: {_said(done)}")
        return done

    return run


def login(run: Run) -> Login:
    """Who is logged in.

    Raises
    ------
    RemoteError
        The host cannot be reached.
    """
    done = run("id -un && pwd", b"")
    user, _, home = done.stdout.decode().strip().partition("\n")
    if done.returncode or not home:
        raise RemoteError(f"id -un && pwd: {_said(done)}")
    return Login(user, home)


def take(run: Run, steps: Iterable[Step], *, dry: bool) -> Iterator[tuple[Step, bool]]:
    """Take the steps that are not done yet.

    Parameters
    ----------
    run
        Runs commands on the host.
    steps
        In order.
    dry
        Change nothing.

    Yields
    ------
    step, done
        Whether it was done before.

    Raises
    ------
    RemoteError
        A step failed; those after it are not taken.
    """
    for step in steps:
        done = run(step.done, b"").returncode == 0
        if not (done or dry):
            made = run(step.make, step.content)
            if made.returncode:
                raise RemoteError(f"{step.what}: {_said(made)}")
        yield step, done


def _said(done: "subprocess.CompletedProcess[bytes]") -> str:
    return done.stderr.decode(errors="replace").strip() or f"exit code {done.returncode}"
