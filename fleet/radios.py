"""Radio protocol and calibration of the vehicles of a fleet file."""

from dataclasses import replace
from typing import Any, Final

from rcopterx.fleet.reading import dataclass_from, replaced
from rcopterx.fleet.schema import FleetError, FleetFile, errors_at
from rcopterx.fleet.vehicle_types import VehicleType, type_of
from rcopterx.radios.calibration import Calibration
from rcopterx.radios.protocol import ProtocolError, RadioProtocol
from rcopterx.radios.registry import create_protocol, default_line, settings_class

MODEL_MATCH_OPTIONS: Final = {"multi": "rx_num", "dsm2_serial": "model", "dsmp": "model"}  # others send none


def calibration_of(fleet: FleetFile, name: str) -> Calibration:
    """Return the calibration of a vehicle's transmitter: that of its type, and the values in the file."""
    own = fleet.vehicles[name].transmitter.calibration
    return replaced(type_calibration(type_of(fleet, name)), own, f"vehicles.{name}.transmitter.calibration")


def type_calibration(own: VehicleType) -> Calibration:
    """Return the calibration of a type; `FleetError` names a wrong key of its radio."""
    radio = own.file.transmitter
    with errors_at(own.source):
        dataclass_from(settings_class(radio.protocol), radio.settings, "transmitter.settings")
        return replaced(Calibration(), radio.calibration, "transmitter.calibration")


def protocol_of(fleet: FleetFile, name: str) -> RadioProtocol:
    """Radio protocol of a transmitter; simulated lines have no parity, as no pseudo-terminal has."""
    transmitter = fleet.vehicles[name].transmitter
    where = f"vehicles.{name}.transmitter"
    required = type_of(fleet, name).file.transmitter
    protocol = transmitter.protocol or required.protocol
    option = MODEL_MATCH_OPTIONS.get(protocol)
    own: dict[str, Any] = {} if option is None else {option: transmitter.model_match}
    wanted = required.settings if protocol == required.protocol else {}
    line = None if fleet.simulator is None else replace(default_line(protocol), parity="N")
    table = own | wanted | transmitter.settings
    settings = dataclass_from(settings_class(protocol), table, f"{where}.settings")
    with errors_at(f"{where}.protocol", ProtocolError):
        radio = create_protocol(protocol, settings, line)
    if transmitter.low_power and "low_power" not in radio.offers:
        raise FleetError(f"{where}.low_power: cannot be asked for with protocol {protocol!r}")
    return radio
