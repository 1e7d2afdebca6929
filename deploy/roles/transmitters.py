"""The role of a transmitter gateway: radios and calibrations from the fleet file."""

from pathlib import Path

from rcopterx.deploy.hosts.run_directory import run_directory, states_directory
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.ports import port_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.radios import calibration_of, protocol_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import limits_of
from rcopterx.transmitter_gateway.process import run_gateway
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings


def run(fleet: FleetFile, gateway: str) -> None:
    """Serve the transmitters of a gateway."""
    run_gateway(gateway_settings(fleet, gateway, run_directory(fleet.name, fleet.bus.namespace)))


def gateway_settings(fleet: FleetFile, gateway: str, directory: Path) -> GatewaySettings:
    """Return the settings of a transmitter gateway process."""
    return GatewaySettings(
        bus=bus_address(fleet, fleet.gateways[gateway].host, gateway),
        name=gateway,
        transmitters=tuple(
            TransmitterSettings(
                vehicle=name,
                port=port_of(fleet, name, directory),
                protocol=protocol_of(fleet, name),
                calibration=calibration_of(fleet, name),
                limits=limits_of(fleet, name),
                low_power=vehicle.transmitter.low_power,
            )
            for name, vehicle in fleet.vehicles.items()
            if vehicle.transmitter.gateway == gateway
        ),
        vehicles=tuple(fleet.vehicles),
        states=states_directory(directory),
        realtime_priority=Priority.GATEWAY.of(fleet),
    )
