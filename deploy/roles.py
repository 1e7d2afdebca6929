"""Runs one process of a fleet: `python -m deploy.roles ROLE UNIT FLEET_FILE`.

The supervisor starts processes through this module; it imports no command-line library, so that an agent that
crashed in flight is back quickly.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bus.session import BusUnreachableError
from deploy.fleet import FleetError, load_fleet
from deploy.run_directory import run_directory

if TYPE_CHECKING:
    from vicon_gateway.settings import TrackerSettings

ROLES = ("router", "simulator", "tracker", "transmitters", "agent")
PR_SET_PDEATHSIG = 1
EXIT_USAGE = 2
EXIT_UNREACHABLE = 3


def end_with_parent() -> None:
    """Receive SIGTERM when the launcher dies, however it dies; gateways then bring their vehicles down."""
    parent = os.environ.get("RCOPTERX_PARENT")
    if parent is None:
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        os.kill(os.getpid(), signal.SIGTERM)


def run_role(role: str, unit: str, fleet_path: Path, record_raw: Path | None = None) -> None:
    """Run one role until it is asked to stop.

    Parameters
    ----------
    role
        One of `ROLES`.
    unit
        Host of a router, simulator or tracker gateway; gateway name of transmitters; vehicle of an agent.
    fleet_path
        The fleet file.
    record_raw
        Where a tracker gateway records the raw stream, instead of what the file says.

    Raises
    ------
    FleetError
        The file or the unit is wrong.
    BusUnreachableError
        No router answers.
    OSError
        An address or a device cannot be used.
    """
    fleet = load_fleet(fleet_path)
    known: dict[str, Mapping[str, object]] = {
        "router": fleet.hosts, "simulator": fleet.hosts, "tracker": fleet.hosts,
        "transmitters": fleet.gateways, "agent": fleet.vehicles,
    }  # fmt: skip
    if role not in known:
        raise FleetError(f"role {role!r} is unknown, allowed are {', '.join(ROLES)}")
    if unit not in known[role]:
        raise FleetError(f"{role}: unknown unit {unit!r}, known are {', '.join(known[role])}")
    # Only what the role needs is imported: start-up time counts when an agent restarts in flight.
    import deploy.role_settings as build

    if role == "router":
        from bus.router import run_router

        others = [fleet.endpoint(host) for host in list(fleet.hosts)[: list(fleet.hosts).index(unit)]]
        listen = build.router_endpoints(fleet, unit)
        run_router(listen, others, fleet.bus.namespace, build.Priority.ROUTER.of(fleet))
        return
    directory = run_directory(fleet.name, fleet.bus.namespace)
    if role == "simulator":
        from simulator.process import run_simulator

        run_simulator(build.simulator_settings(fleet, directory))
    elif role == "tracker":
        _run_tracker(build.tracker_settings(fleet), record_raw)
    elif role == "transmitters":
        from transmitter_gateway.process import run_gateway

        run_gateway(build.gateway_settings(fleet, unit, directory))
    else:
        from agents.process import run_agent

        run_agent(*build.pilot_of(fleet, unit))


def _run_tracker(settings: "TrackerSettings", record_raw: Path | None) -> None:
    from vicon_gateway.brands import LibraryMissingError
    from vicon_gateway.process import run_tracker_gateway
    from vicon_gateway.recording_file import RecordingFileError

    if record_raw is not None and settings.brand is not None:
        raise FleetError("--record-raw: only the stream of brand 'vicon' can be recorded")
    field = "tracker.record_raw" if record_raw is None else "--record-raw"
    try:
        run_tracker_gateway(replace(settings, record_raw=record_raw or settings.record_raw))
    except RecordingFileError as error:
        raise FleetError(f"{field}: {error}") from None
    except LibraryMissingError as error:
        raise FleetError(f"tracker.brand: {error}") from None


def run_reporting(run: Callable[[], None]) -> None:
    """Run a role; what ends it for a reason somebody can mend becomes a line and an exit code."""
    try:
        run()
    except FleetError as error:
        print(error, file=sys.stderr)
        sys.exit(EXIT_USAGE)
    except (BusUnreachableError, OSError) as error:
        print(error, file=sys.stderr)
        sys.exit(EXIT_UNREACHABLE)


def main() -> None:
    """Entry point of a supervised process."""
    if len(sys.argv) != 4:
        sys.exit(f"usage: python -m deploy.roles {{{','.join(ROLES)}}} UNIT FLEET_FILE")
    end_with_parent()
    run_reporting(lambda: run_role(sys.argv[1], sys.argv[2], Path(sys.argv[3])))


if __name__ == "__main__":
    main()
