"""Directories and files of a running fleet on this host."""

import errno
import hashlib
import os
import stat
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rcopterx.bus.clock import NANO, Clock
from rcopterx.flights.flights import default_directory
from rcopterx.places import try_place

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile  # imports slowly

VARIABLE = "RCOPTERX_RUN"  # environment variable with the place of run directories
LONGEST_SOCKET_PATH = 100
SHARED_MEMORY = Path("/dev/shm")  # files here are memory: writing to them never waits for a disk
LOCKSTEP = ".lockstep"  # file with the time of a fleet in lockstep; no vehicle can have this name


def base_directories() -> list[Path]:
    """Return where run directories may be: `RCOPTERX_RUN`; or `XDG_RUNTIME_DIR`, then a temporary place."""
    chosen, runtime = os.environ.get(VARIABLE), os.environ.get("XDG_RUNTIME_DIR")
    if chosen is not None:
        return [Path(chosen)]
    temporary = Path(tempfile.gettempdir()) / f"rcopterx-{os.getuid()}"
    return [Path(runtime) / "rcopterx", temporary] if runtime else [temporary]


def run_directory(fleet_name: str, namespace: str | None) -> Path:
    """Return the directory of a fleet, created if missing, for its owner only: who reaches it can steer.

    It is in the first place that can be used. Raises `OSError`: there is none, or it belongs to another user;
    says how to choose another place.
    """
    *others, last = base_directories()
    base = next(filter(_usable, others), last)
    path = base / (fleet_name if namespace is None else f"{fleet_name}-{namespace}")
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
        check_owner(path.parent)
        check_owner(path)
        path.chmod(0o700)
        (path / "log").mkdir(exist_ok=True)
    except OSError as error:
        reason = f"run directory {path}: {error.strerror}; set RCOPTERX_RUN to a directory you may write to"
        raise OSError(reason) from None
    return path


def _usable(base: Path) -> bool:
    try:
        base.mkdir(parents=True, exist_ok=True, mode=0o700)
        try_place(base)
    except OSError:
        return False
    return True


def check_owner(path: Path) -> None:
    """Raise `OSError` for a link, or a directory that another user has put in the place of ours."""
    status = path.lstat()
    if not stat.S_ISDIR(status.st_mode):
        raise OSError(errno.ENOTDIR, f"{path} is a link or a file")
    if status.st_uid not in (os.geteuid(), 0):
        raise OSError(errno.EPERM, f"{path} belongs to another user")


def serial_path(port: str, directory: Path) -> Path:
    """Return the serial device of a transmitter; relative paths are in the run directory."""
    return Path(port) if Path(port).is_absolute() else directory / port


def snapshot_path(host: str, directory: Path) -> Path:
    """Return the path of the snapshot of the fleet file that the processes of a host read."""
    return directory / f"fleet-{host}.json"


def log_directory(fleet: "FleetFile") -> Path:
    """Return the directory of the flight logs of a fleet."""
    chosen = fleet.log.directory
    return default_directory() if chosen is None else Path(chosen).expanduser()


class Begun(NamedTuple):
    """A flight of a host: its name, and the wall clock at zero of the fleet's clock [ns]."""

    name: str
    zero_ns: int

    @classmethod
    def now(cls, name: str, clock: Clock) -> "Begun":
        """Return a flight that begins now."""
        return cls(name, time.time_ns() - round(clock.now() * NANO))


def flight_path(host: str, directory: Path) -> Path:
    """Return the file with the current flight, which a restarted recorder continues."""
    return directory / f"flight-{host}.txt"


def write_flight(path: Path, flight: Begun) -> None:
    """Write the file of the current flight."""
    path.write_text(f"{flight.name} {flight.zero_ns}", encoding="utf-8")


def read_flight(path: Path) -> Begun | None:
    """Return the current flight; None if no launcher has begun one."""
    try:
        name, zero_ns = path.read_text(encoding="utf-8").split()
        return Begun(name, int(zero_ns))
    except (OSError, ValueError):
        return None


def states_directory(directory: Path) -> Path:
    """Return the directory of the pages in which gateways keep the states of vehicles, by run directory."""
    digest = hashlib.sha256(bytes(directory)).hexdigest()[:16]
    return SHARED_MEMORY / f"rcopterx-{os.geteuid()}-{digest}"


def states_directories() -> list[Path]:
    """Return these directories of all fleets of this user."""
    return list(SHARED_MEMORY.glob(f"rcopterx-{os.geteuid()}-*"))


def lockstep_path(directory: Path) -> Path:
    """Return the path of the page that holds the time of a fleet in lockstep."""
    return states_directory(directory) / LOCKSTEP


def router_socket(host: str, directory: Path) -> str | None:
    """Return the Zenoh endpoint of a router's Unix socket; None if its path is too long."""
    path = directory / f"router-{host}.sock"
    return f"unixsock-stream/{path}" if len(str(path)) <= LONGEST_SOCKET_PATH else None
