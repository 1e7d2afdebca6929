"""The role of the simulated laboratory."""

from dataclasses import replace
from pathlib import Path

from rcopterx.bus.message import Four
from rcopterx.bus.processes import SIMULATOR
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.ports import laboratory_of, port_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.deploy.roles.tracker import tracker_address
from rcopterx.fleet.formation_check import start_places
from rcopterx.fleet.radios import calibration_of, protocol_of
from rcopterx.fleet.reading import replaced
from rcopterx.fleet.schema import FleetError, FleetFile, check_known, errors_at
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.radios.crazyradio import RADIO
from rcopterx.radios.crtp import RadioAddress
from rcopterx.simulator.conditions import FIRST_ORDER, PRESETS, Conditions
from rcopterx.simulator.crazyradio import place_of
from rcopterx.simulator.plant import BodyPose, added_plant
from rcopterx.simulator.process import run_simulator
from rcopterx.simulator.settings import SimulatedRadio, SimulatedVehicle, SimulatorSettings


def run(fleet: FleetFile, _host: str) -> None:
    """Simulate the laboratory."""
    run_simulator(simulator_settings(fleet, run_directory(fleet.name, fleet.bus.namespace)))


def conditions_of(fleet: FleetFile) -> Conditions:
    """Return the conditions of the simulated laboratory; `FleetError` if they cannot be had."""
    if fleet.simulator is None:
        raise FleetError("simulator: this fleet flies hardware, there is nothing to simulate")
    preset = fleet.simulator.conditions
    check_known("simulator.conditions", "preset", preset, PRESETS)
    low, high = fleet.volume.min_m, fleet.volume.max_m
    conditions = replace(
        PRESETS[preset],
        transport_delay_s=0.0,  # the emulated radio link has its own delay and frames
        radio_period_s=0.0,
        volume_min_m=(low[0], low[1], -0.1),
        volume_max_m=high,
    )
    conditions = replaced(conditions, fleet.simulator.condition_overrides, "simulator.condition_overrides")
    if conditions.attitude_plant != FIRST_ORDER:
        with errors_at(f"simulator.conditions: {conditions.attitude_plant}", ValueError):
            added_plant(conditions.attitude_plant)
    return conditions


def simulator_settings(fleet: FleetFile, directory: Path) -> SimulatorSettings:
    """Return the settings of the simulator process."""
    conditions, simulator = conditions_of(fleet), fleet.simulator
    assert simulator is not None
    host, port = tracker_address(fleet)
    starts = start_places(fleet)
    return SimulatorSettings(
        bus=bus_address(fleet, simulator.host, SIMULATOR),
        tracker_host=host,
        tracker_port=port,
        profile=simulator.profile,
        rate_hz=simulator.rate_hz,
        conditions=conditions,
        seed=simulator.seed,
        vehicles=tuple(_simulated(fleet, name, directory, starts[name]) for name in fleet.vehicles),
        realtime_priority=Priority.SIMULATOR.of(fleet),
    )


def _simulated(fleet: FleetFile, name: str, directory: Path, start: Four) -> SimulatedVehicle:
    vehicle = fleet.vehicles[name]
    return SimulatedVehicle(
        name=name,
        subject=vehicle.subject,
        model=model_of(fleet, name),
        start=BodyPose(start[:3], start[3]),
        port=simulated_port_of(fleet, name, directory),
        radio=SimulatedRadio(protocol_of(fleet, name), vehicle.transmitter.model_match),
        calibration=calibration_of(fleet, name),
    )


def simulated_port_of(fleet: FleetFile, name: str, directory: Path) -> str:
    """Return where a simulated vehicle receives what is sent to its port; `FleetError` as `port_of`."""
    port = port_of(fleet, name, directory)
    return place_of(laboratory_of(directory), RadioAddress.of(port)) if port.startswith(RADIO) else port
