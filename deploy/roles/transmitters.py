"""The role of a transmitter gateway: radios and calibrations from the fleet file."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from rcopterx.deploy.fleet_file.reading import dataclass_from
from rcopterx.deploy.fleet_file.schema import FleetError, FleetFile, VehicleConfig
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.arbiter_limits import limits_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.deploy.run_directory import run_directory, serial_path
from rcopterx.transmitter_gateway.calibration import Calibration
from rcopterx.transmitter_gateway.process import run_gateway
from rcopterx.transmitter_gateway.protocols.base import ProtocolError, RadioProtocol
from rcopterx.transmitter_gateway.protocols.registry import create_protocol, default_line
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings

MODEL_MATCH_OPTIONS: Final = {"multi": "rx_num", "dsm2_serial": "model", "dsmp": "model"}
"""What a radio protocol calls the number of the model match; the others have none on the wire."""


def run(fleet: FleetFile, gateway: str) -> None:
    """Serve the transmitters of a gateway."""
    run_gateway(gateway_settings(fleet, gateway, run_directory(fleet.name, fleet.bus.namespace)))


def gateway_settings(fleet: FleetFile, gateway: str, directory: Path) -> GatewaySettings:
    """Settings of a transmitter gateway process."""
    return GatewaySettings(
        bus=bus_address(fleet, fleet.gateways[gateway].host),
        name=gateway,
        transmitters=tuple(
            TransmitterSettings(
                vehicle=name,
                port=str(serial_path(vehicle.transmitter.port, directory)),
                protocol=protocol_of(fleet, name),
                calibration=calibration_of(vehicle, name),
                limits=limits_of(fleet, name),
                low_power=vehicle.transmitter.low_power,
            )
            for name, vehicle in fleet.vehicles.items()
            if vehicle.transmitter.gateway == gateway
        ),
        vehicles=tuple(fleet.vehicles),
        realtime_priority=Priority.GATEWAY.of(fleet),
    )


def calibration_of(vehicle: VehicleConfig, name: str) -> Calibration:
    """Calibration of a vehicle's transmitter."""
    return dataclass_from(
        Calibration, vehicle.transmitter.calibration, f"vehicles.{name}.transmitter.calibration"
    )


def protocol_of(fleet: FleetFile, name: str) -> RadioProtocol:
    """Radio protocol of a vehicle's transmitter.

    A pseudo-terminal keeps no parity, so simulated lines have none (dsm2_transmitters.md section 9).
    """
    transmitter = fleet.vehicles[name].transmitter
    where = f"vehicles.{name}.transmitter"
    protocol = transmitter.protocol
    option = MODEL_MATCH_OPTIONS.get(protocol)
    own: dict[str, Any] = {} if option is None else {option: transmitter.model_match}
    line = None if fleet.simulator is None else replace(default_line(protocol), parity="N")
    try:
        radio = create_protocol(protocol, own | transmitter.settings, line)
    except ProtocolError as error:
        raise FleetError(f"{where}.settings: {error}") from None
    if transmitter.low_power and "low_power" not in radio.offers:
        raise FleetError(f"{where}.low_power: cannot be asked for with protocol {protocol!r}")
    return radio
