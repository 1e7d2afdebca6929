"""The role of the recorder: where the flight log goes, and what it says of the flight."""

import logging
import time
from functools import partial
from pathlib import Path
from typing import Final

import msgspec

from rcopterx.deploy.hosts.run_directory import flight_path, run_directory
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.snapshot import digest_of
from rcopterx.flights.flight_writing import FlightSettings
from rcopterx.flights.flights import default_directory, flight_name
from rcopterx.flights.provenance import provenance
from rcopterx.flights.recorder import NANO, RecorderSettings, run_recorder, schemas

MB: Final = 1_000_000
GB: Final = 1_000_000_000


def run(fleet: FleetFile, host: str) -> None:
    """Record what is on the bus."""
    run_recorder(
        recorder_settings(fleet, host, time.time_ns(), time.monotonic()),
        logging.getLogger(__name__).error,
    )


def log_directory(fleet: FleetFile) -> Path:
    """Where the flight logs of a fleet lie."""
    chosen = fleet.log.directory
    return default_directory() if chosen is None else Path(chosen).expanduser()


def recorder_settings(fleet: FleetFile, host: str, now_ns: int, now_s: float) -> RecorderSettings:
    """Settings of the recorder process.

    Parameters
    ----------
    fleet, host
        The fleet, and the host that records.
    now_ns, now_s
        Wall clock and monotonic clock of this moment.
    """
    wall_ns = now_ns - round(now_s * NANO)
    return RecorderSettings(
        bus=bus_address(fleet, host),
        host=host,
        flight=partial(flight_settings, fleet, host, now_ns / NANO, wall_ns),
        wall_ns=wall_ns,
        realtime_priority=Priority.RECORDER.of(fleet),
    )


def flight_settings(fleet: FleetFile, host: str, started_s: float, wall_ns: int) -> FlightSettings:
    """Where and how a flight is recorded, and what its log says of the fleet and of this computer.

    Parameters
    ----------
    fleet, host
        The fleet, and the host that records.
    started_s
        Wall clock at the start [s].
    wall_ns
        Wall clock where the monotonic one is zero [ns].
    """
    metadata = {
        "fleet": fleet.name,
        "digest": digest_of(fleet),
        "host": host,
        "started": time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(started_s)),
        "monotonic_zero_ns": str(wall_ns),
        "seed": "" if fleet.simulator is None else str(fleet.simulator.seed),
        **provenance(),
    }
    return FlightSettings(
        directory=log_directory(fleet),
        flight=_flight_under_way(fleet, host) or flight_name(fleet.name, started_s),
        metadata=metadata,
        fleet=msgspec.json.encode(fleet),
        schemas=schemas(),
        part_bytes=round(fleet.log.part_mb * MB),
        keep_bytes=round(fleet.log.keep_gb * GB),
    )


def _flight_under_way(fleet: FleetFile, host: str) -> str:
    """Flight that the launcher of this host has begun; empty without a launcher."""
    try:
        return flight_path(host, run_directory(fleet.name, fleet.bus.namespace)).read_text(encoding="utf-8")
    except OSError:
        return ""
