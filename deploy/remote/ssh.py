"""Takes steps on a host through the ssh client of the system, with the user's keys and settings."""

import subprocess
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from rcopterx.deploy.remote.plan import Login, Step

OPTIONS: Final = ("-o", "BatchMode=yes", "-o", "ConnectTimeout=10")
"""Without prompts for passwords: keys and agents are needed."""
UNREACHABLE: Final = 255  # exit code of ssh itself


class RemoteError(RuntimeError):
    """A host cannot be reached, or a command on it failed; contains its output."""


Run = Callable[[str, bytes], "subprocess.CompletedProcess[bytes]"]
"""Runs a shell command with a standard input."""


def on(target: str) -> Run:
    """Return a function that runs commands at the ssh target, such as `lab@192.168.0.11`."""

    def run(command: str, content: bytes) -> "subprocess.CompletedProcess[bytes]":
        done = subprocess.run(
            ["ssh", *OPTIONS, "--", target, command], input=content, capture_output=True, check=False
        )
        if done.returncode == UNREACHABLE:
            raise RemoteError(f"{target}: {_output(done)}")
        return done

    return run


def login(run: Run) -> Login:
    """Return user and home directory; raises `RemoteError` if the host cannot be reached."""
    done = run("id -un && pwd", b"")
    user, _, home = done.stdout.decode().strip().partition("\n")
    if done.returncode or not home:
        raise RemoteError(f"id -un && pwd: {_output(done)}")
    return Login(user, home)


def take(run: Run, steps: Iterable[Step], *, dry: bool) -> Iterator[tuple[Step, bool]]:
    """Take the steps that are not done yet, none if `dry`; yield each with whether it was done before."""
    for step in steps:
        done = run(step.done, b"").returncode == 0
        if not (done or dry):
            made = run(step.make, step.content)
            if made.returncode:
                raise RemoteError(f"{step.what}: {_output(made)}")
        yield step, done


def _output(done: "subprocess.CompletedProcess[bytes]") -> str:
    return done.stderr.decode(errors="replace").strip() or f"exit code {done.returncode}"
