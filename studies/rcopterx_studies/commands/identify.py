"""What `identify --from FILE.csv` does: reads flights of Crazyflies that were recorded elsewhere."""

from pathlib import Path

from rcopterx.control.identification.recording import FlightRecording
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_types import type_of
from rcopterx.radios.crazyflie import CrazyflieProtocol
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx_studies.experiments.flight_csv import CommandScale, read_flight


def recorded_flight(file: FleetFile, name: str, path: Path) -> FlightRecording:
    """Read a CSV file as a flight of a vehicle, with what full sticks command over its own radio.

    Raises `FleetError` for a vehicle with another radio, `RecordingError` for a file that cannot be used.
    """
    radio = protocol_of(file, name)
    if not isinstance(radio, CrazyflieProtocol):
        raise FleetError(f"vehicles.{name}: a CSV file is of a vehicle with the radio protocol 'crazyflie'")
    full = CommandScale(radio.settings.full_tilt_deg, radio.settings.full_yaw_rate_deg_s, FULL_THRUST)
    return read_flight(path, type_of(file, name).name, full)
