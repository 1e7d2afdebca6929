"""The role of the recorder: place and metadata of the flight log."""

import logging
import time
from functools import partial
from typing import Final

import msgspec

from rcopterx.deploy.hosts.run_directory import Begun, flight_path, log_directory, read_flight, run_directory
from rcopterx.deploy.roles.addresses import bus_address, clock_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.reading import digest_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import FlightSettings
from rcopterx.flights.flights import new_flight_name
from rcopterx.flights.provenance import provenance
from rcopterx.flights.recorder import RecorderSettings, run_recorder

MB: Final = 1_000_000
GB: Final = 1_000_000_000


def run(fleet: FleetFile, host: str) -> None:
    """Record the messages on the bus."""
    run_recorder(recorder_settings(fleet, host, time.time()), logging.getLogger(__name__).error)


def recorder_settings(fleet: FleetFile, host: str, started_s: float) -> RecorderSettings:
    """Return the settings of a recorder that starts at a time of the wall clock."""
    under_way = read_flight(flight_path(host, run_directory(fleet.name, fleet.bus.namespace)))
    flight = under_way or Begun.now(
        new_flight_name(fleet.name, started_s, log_directory(fleet)), clock_of(fleet)
    )
    return RecorderSettings(
        bus=bus_address(fleet, host),
        host=host,
        flight=partial(flight_settings, fleet, host, started_s, flight),
        wall_ns=flight.zero_ns,
        realtime_priority=Priority.RECORDER.of(fleet),
    )


def flight_settings(fleet: FleetFile, host: str, started_s: float, flight: Begun) -> FlightSettings:
    """Return where and how the flight that began at `started_s` (wall clock) is recorded."""
    metadata = {
        "fleet": fleet.name,
        "digest": digest_of(fleet),
        "host": host,
        "started": time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(started_s)),
        "monotonic_zero_ns": str(flight.zero_ns),
        "speed": f"{fleet.clock.speed:g}",
        "seed": "" if fleet.simulator is None else str(fleet.simulator.seed),
        **provenance(),
    }
    return FlightSettings(
        directory=log_directory(fleet),
        flight=flight.name,
        metadata=metadata,
        fleet=msgspec.json.encode(fleet),
        part_bytes=round(fleet.log.part_mb * MB),
        keep_bytes=round(fleet.log.keep_gb * GB),
    )
