"""What `identify --from FILE.csv` does: reads flights that were recorded elsewhere."""

from pathlib import Path

from rcopterx.control.identification.recording import FlightRecording
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_types import type_of
from rcopterx.radios.crazyflie import CrazyflieProtocol
from rcopterx_studies.experiments.flight_csv import read_columns, read_flight, read_mapped


def recorded_flight(file: FleetFile, name: str, path: Path, columns: Path | None) -> FlightRecording:
    """Read a CSV file as a flight of a vehicle, by a map of its columns if there is one.

    Without a map it is of a Crazyflie, with what full sticks command over its own radio. Raises `FleetError`
    for a vehicle with another radio, `RecordingError` for a file that cannot be used.
    """
    kind = type_of(file, name).name
    if columns is not None:
        return read_mapped(path, kind, read_columns(columns))
    radio = protocol_of(file, name)
    if not isinstance(radio, CrazyflieProtocol):
        raise FleetError(f"vehicles.{name}: without --columns its radio protocol has to be 'crazyflie'")
    return read_flight(path, kind, radio.settings)
