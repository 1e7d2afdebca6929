"""The role of a transmitter gateway: radios and calibrations from the fleet file."""

import time
from collections.abc import Callable
from pathlib import Path

from rcopterx.deploy.hosts.run_directory import run_directory, states_directory
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.ports import laboratory_of, port_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.radios import calibration_of, protocol_of
from rcopterx.fleet.schema import FleetFile, errors_at
from rcopterx.fleet.vehicle_models import battery_of, limits_of
from rcopterx.radios.crazyradio import UsbDevice, find_dongle
from rcopterx.radios.protocol import ProtocolError
from rcopterx.transmitter_gateway.process import run_gateway
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings
from rcopterx.transmitter_gateway.switches import prepare_channels


def run(fleet: FleetFile, gateway: str) -> None:
    """Serve the transmitters of a gateway."""
    run_gateway(gateway_settings(fleet, gateway, run_directory(fleet.name, fleet.bus.namespace)))


def gateway_settings(fleet: FleetFile, gateway: str, directory: Path) -> GatewaySettings:
    """Return the settings of a transmitter gateway process; `FleetError` names the wrong field."""
    return GatewaySettings(
        bus=bus_address(fleet, fleet.gateways[gateway].host, gateway),
        transmitters=tuple(_transmitter(fleet, name, directory) for name in fleet.served_by(gateway)),
        vehicles=tuple(fleet.tracked),
        states=states_directory(directory),
        realtime_priority=Priority.GATEWAY.of(fleet),
        dongles=find_dongle if fleet.simulator is None else _emulated(fleet, directory),
    )


def _transmitter(fleet: FleetFile, name: str, directory: Path) -> TransmitterSettings:
    settings = TransmitterSettings(
        vehicle=name,
        port=port_of(fleet, name, directory),
        protocol=protocol_of(fleet, name),
        calibration=calibration_of(fleet, name),
        limits=limits_of(fleet, name),
        battery=battery_of(fleet, name),
        low_power=fleet.vehicles[name].transmitter.low_power,
    )
    with errors_at(f"vehicles.{name}.transmitter.calibration", ProtocolError):
        prepare_channels(settings.protocol, settings.calibration, settings.limits)
    return settings


def _emulated(fleet: FleetFile, directory: Path) -> Callable[[int], UsbDevice]:
    """Crazyradios of a simulated laboratory; in lockstep their packets take no time."""
    # Imported here: on hardware no process imports the simulator.
    from rcopterx.simulator.crazyradio import EmulatedDongle

    def sleep(seconds: float) -> None:
        if not fleet.clock.lockstep:
            time.sleep(fleet.clock.real_s(seconds))

    return lambda number: EmulatedDongle(number, laboratory_of(directory), sleep)
