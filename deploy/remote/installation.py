"""The installation of a host as steps, which can be shown before they are taken over ssh, and repeated."""

import hashlib
import math
import shlex
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Final

from rcopterx.deploy.certificates.files import AUTHORITY, directory_of, host_name
from rcopterx.deploy.processes.supervisor import STOP_LIMIT_S
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_models import longest_shutdown_s

DIRECTORY: Final = "rcopterx"  # directory of the installation, in the home of the user
OPTIONS: Final = ("-o", "BatchMode=yes", "-o", "ConnectTimeout=10")
"""Without prompts for passwords: keys and agents are needed."""
UNREACHABLE: Final = 255  # exit code of ssh itself

Run = Callable[[str, bytes], "subprocess.CompletedProcess[bytes]"]
"""Runs a shell command with a standard input."""


class RemoteError(RuntimeError):
    """A host cannot be reached, or a command on it failed; contains its output."""


@dataclass(frozen=True)
class Step:
    """One step of an installation."""

    what: str  # description for the user
    done: str  # shell command that succeeds if the step is done
    make: str  # shell command that takes the step
    content: bytes = b""  # standard input of `make`


@dataclass(frozen=True)
class Login:
    """User on a host, and its home directory."""

    user: str
    home: str


def steps(fleet: FleetFile, fleet_path: Path, host: str, login: Login, wheel: Path) -> Iterator[Step]:
    """Yield the steps of the installation of a host; `FleetError` for unusable types, `OSError` for files."""
    type_files, unit = _type_files(fleet), _unit(fleet, host, login)
    software = wheel.read_bytes()
    yield _file(f"{DIRECTORY}/{wheel.name}", software, 0o644)
    yield _installed(wheel.name, hashlib.sha256(software).hexdigest())
    yield _file(f"{DIRECTORY}/{fleet.name}.toml", fleet_path.read_bytes(), 0o644)
    for name in type_files:
        yield _file(f"{DIRECTORY}/{name}", (fleet_path.parent / name).read_bytes(), 0o644)
    if (directory := directory_of(fleet)) is not None:
        there = str(fleet.security.certificates).removeprefix("~/")
        for name in (f"{AUTHORITY}.pem", f"{host_name(host)}.pem", f"{host_name(host)}.key"):
            mode = 0o600 if name.endswith(".key") else 0o644
            yield _file(f"{there}/{name}", (directory / name).read_bytes(), mode)
    yield _file(f"{DIRECTORY}/{unit_name(fleet)}", unit.encode(), 0o644)
    yield _enabled(unit_name(fleet))


def _type_files(fleet: FleetFile) -> list[str]:
    """Return the paths of the files of vehicle types, relative to the fleet file."""
    found = dict.fromkeys(one.type for one in fleet.vehicles.values() if one.type.endswith(".toml"))
    for name in found:
        if name.startswith("/") or ".." in Path(name).parts:
            raise FleetError(f"{name}: a type file must be in or below the directory of the fleet file")
    return list(found)


def unit_name(fleet: FleetFile) -> str:
    """Return the name of the systemd unit of a host of this fleet."""
    return f"rcopterx-{fleet.name}.service"


def _unit(fleet: FleetFile, host: str, login: Login) -> str:
    """Return the systemd unit of a host; gateways may land their vehicles before it is killed."""
    landing_s = fleet.clock.real_s(longest_shutdown_s(fleet, host))
    unit = (files("rcopterx.deploy") / "systemd" / "host.service").read_text("utf-8")
    return unit.format(
        host=host,
        fleet=fleet.name,
        user=login.user,
        home=login.home,
        directory=DIRECTORY,
        highest_priority=max(Priority).of(fleet),
        # A hung agent is killed after the limit, then a gateway after the limit and a landing.
        stop_s=math.ceil(2 * STOP_LIMIT_S + landing_s),
    )


def _file(path: str, content: bytes, mode: int) -> Step:
    """Return the step that writes a file; it is replaced as a whole."""
    quoted, new = shlex.quote(path), shlex.quote(f"{path}.new")
    checksum = hashlib.sha256(content).hexdigest()
    return Step(
        what=path,
        done=f'[ "$(sha256sum < {quoted})" = "{checksum}  -" ] && [ "$(stat -c %a {quoted})" = {mode:o} ]',
        make=f"umask 077 && mkdir -p $(dirname {quoted}) && cat > {new} && chmod {mode:o} {new} "
        f"&& mv {new} {quoted}",
        content=content,
    )


def _installed(wheel: str, checksum: str) -> Step:
    mark = f"{DIRECTORY}/venv/installed"
    return Step(
        what=f"{wheel} installed in {DIRECTORY}/venv",
        done=f'[ "$(cat {mark})" = {checksum} ]',
        make=f"python3 -m venv {DIRECTORY}/venv && {DIRECTORY}/venv/bin/pip install --quiet --upgrade "
        f"--force-reinstall {shlex.quote(f'{DIRECTORY}/{wheel}')} && echo {checksum} > {mark}",
    )


def _enabled(unit: str) -> Step:
    return Step(
        what=f"/etc/systemd/system/{unit}",
        done=f"cmp -s {DIRECTORY}/{unit} /etc/systemd/system/{unit}",
        make=f"sudo -n install -m 644 {DIRECTORY}/{unit} /etc/systemd/system/{unit} "
        f"&& sudo -n systemctl daemon-reload && sudo -n systemctl enable --quiet {unit}",
    )


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
