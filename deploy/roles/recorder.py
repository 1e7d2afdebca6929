"""The role of the recorder: place and metadata of the flight log."""

import logging
import time
from functools import partial
from pathlib import Path
from typing import Final

import msgspec

from rcopterx.deploy.hosts.run_directory import flight_path, run_directory
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.reading import digest_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import FlightSettings
from rcopterx.flights.flights import default_directory, flight_name
from rcopterx.flights.provenance import provenance
from rcopterx.flights.recorder import NANO, RecorderSettings, run_recorder, schemas

MB: Final = 1_000_000
GB: Final = 1_000_000_000


def run(fleet: FleetFile, host: str) -> None:
    """Record the messages on the bus."""
    run_recorder(
        recorder_settings(fleet, host, time.time_ns(), time.monotonic()),
        logging.getLogger(__name__).error,
    )


def log_directory(fleet: FleetFile) -> Path:
    """Return the directory of the flight logs of a fleet."""
    chosen = fleet.log.directory
    return default_directory() if chosen is None else Path(chosen).expanduser()


def recorder_settings(fleet: FleetFile, host: str, now_ns: int, now_s: float) -> RecorderSettings:
    """Return the settings of the recorder, at the wall clock `now_ns` and the monotonic clock `now_s`."""
    wall_ns = now_ns - round(now_s * NANO)
    return RecorderSettings(
        bus=bus_address(fleet, host),
        host=host,
        flight=partial(flight_settings, fleet, host, now_ns / NANO, wall_ns),
        wall_ns=wall_ns,
        realtime_priority=Priority.RECORDER.of(fleet),
    )


def flight_settings(fleet: FleetFile, host: str, started_s: float, wall_ns: int) -> FlightSettings:
    """Return where and how a flight is recorded, with its metadata.

    Parameters
    ----------
    started_s
        Wall clock at the start [s].
    wall_ns
        Wall clock at the zero of the monotonic clock [ns].
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
    """Return the flight that the launcher of this host has begun; empty without a launcher."""
    try:
        return flight_path(host, run_directory(fleet.name, fleet.bus.namespace)).read_text(encoding="utf-8")
    except OSError:
        return ""
