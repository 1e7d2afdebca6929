"""What each process of a fleet needs, read from the fleet file."""

from dataclasses import replace
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from agents.formation.limit_scaling import limit_scale_of
from agents.formation.succession import Succession
from agents.separation.avoidance import SeparationEllipsoid
from agents.settings import AgentSettings
from bus.session import BusAddress
from deploy.fleet import Fleet, FleetError, Vehicle, formation_place
from deploy.formation_check import check_formation, links_of
from deploy.motion_capture import brand_of, raw_recording, tracker_address
from deploy.run_directory import router_socket, run_directory, serial_path
from deploy.tables import dataclass_from, replaced
from simulator.conditions import Conditions, conditions_from
from simulator.plant import Pose
from simulator.settings import SimulatedRadio, SimulatedVehicle, SimulatorSettings
from transmitter_gateway.calibration import Calibration
from transmitter_gateway.limits import ArbiterLimits, Fence, SurveillanceLimits
from transmitter_gateway.protocols.base import ProtocolError, RadioProtocol
from transmitter_gateway.protocols.registry import create_protocol, default_line
from transmitter_gateway.settings import GatewaySettings, TransmitterSettings
from vehicles.model import Model
from vehicles.types import TYPES
from vicon_gateway.settings import TrackerSettings

if TYPE_CHECKING:
    from agents.pilot import Pilot

MODEL_MATCH_OPTIONS: Final = {"multi": "rx_num", "dsm2_serial": "model", "dsmp": "model"}
"""What a radio protocol calls the number of the model match; the others have none on the wire."""


def bus_address(fleet: Fleet, host: str) -> BusAddress:
    """Where processes of a host find their router: its socket, or its address if that is not there."""
    return BusAddress(tuple(router_endpoints(fleet, host)), fleet.name, fleet.bus.namespace)


def router_endpoints(fleet: Fleet, host: str) -> list[str]:
    """Endpoints the router of a host listens on, the fastest first."""
    local = router_socket(host, run_directory(fleet.name, fleet.bus.namespace))
    return [fleet.endpoint(host)] if local is None else [local, fleet.endpoint(host)]


class Priority(IntEnum):
    """How far processes run above the fleet's real-time priority.

    What others wait for comes first: messages are forwarded at once, and a leader plans before its followers.
    The simulator computes its helicopters' motion while nobody else needs the processor.
    """

    ROUTER = 6
    GATEWAY = 4
    LEADER = 2
    FOLLOWER = 1
    SIMULATOR = 0

    def of(self, fleet: Fleet) -> int:
        """SCHED_FIFO priority; 0 if the fleet wants none."""
        base = fleet.bus.realtime_priority
        return base + self if base else 0


def model_of(fleet: Fleet, name: str) -> Model:
    """Model of a vehicle: its type with the parameters the file changes and the volume's position bounds.

    Raises
    ------
    FleetError
        Unknown type or parameter.
    """
    vehicle = fleet.vehicles[name]
    where = f"vehicles.{name}"
    if vehicle.type not in TYPES:
        raise FleetError(f"{where}.type: unknown type {vehicle.type!r}, allowed are {', '.join(TYPES)}")
    model = replaced(TYPES[vehicle.type], vehicle.model, f"{where}.model")
    low, high = fleet.volume.min_m, fleet.volume.max_m
    return replace(
        model,
        state_min=(*low, *model.state_min[3:]),
        state_max=(*high, *model.state_max[3:]),
    )


def agent_settings(fleet: Fleet, name: str) -> AgentSettings:
    """Settings of the agent of a vehicle."""
    vehicle = fleet.vehicles[name]
    control = vehicle.control
    links = links_of(fleet)
    models = {other: model_of(fleet, other) for other in fleet.vehicles}
    return AgentSettings(
        bus=bus_address(fleet, vehicle.host),
        vehicle=name,
        vehicles=tuple(fleet.vehicles),
        model=models[name],
        volume_min_m=fleet.volume.min_m,
        volume_max_m=fleet.volume.max_m,
        controller=control.controller,
        estimator=control.estimator,
        horizon=control.horizon,
        period_s=control.period_s,
        controller_settings=control.settings,
        estimator_settings=control.estimator_settings,
        leader_wait_s=control.leader_wait_s,
        following=links[name],
        share=limit_scale_of(links, models, name),
        models=models,
        succession=succession_of(fleet, name),
        minimum_distance_m=limits_of(fleet, name).surveillance.minimum_distance_m,
        clearance=clearance_of(fleet),
        realtime_priority=(Priority.FOLLOWER if vehicle.follow else Priority.LEADER).of(fleet),
    )


def clearance_of(fleet: Fleet) -> SeparationEllipsoid | None:
    """What vehicles keep clear of each other; None for no avoidance."""
    avoidance = fleet.avoidance
    return SeparationEllipsoid(avoidance.horizontal_m, avoidance.vertical_m) if avoidance.enabled else None


def succession_of(fleet: Fleet, name: str) -> Succession:
    """What a vehicle does about lost leaders, and the order of successors all vehicles agree on."""
    promotable = [other for other, vehicle in fleet.vehicles.items() if vehicle.leader_lost.then == "promote"]
    lost = fleet.vehicles[name].leader_lost
    return Succession(
        policy=lost.then,
        after_s=lost.after_s,
        orders={
            leader: tuple(dict.fromkeys((*vehicle.successors, *promotable)))
            for leader, vehicle in fleet.vehicles.items()
        },
        promotable=frozenset(promotable),
    )


def calibration_of(vehicle: Vehicle, name: str) -> Calibration:
    """Calibration of a vehicle's transmitter."""
    return dataclass_from(
        Calibration, vehicle.transmitter.calibration, f"vehicles.{name}.transmitter.calibration"
    )


def protocol_of(fleet: Fleet, name: str) -> RadioProtocol:
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


def limits_of(fleet: Fleet, name: str) -> ArbiterLimits:
    """Limits the transmitter gateway enforces for a vehicle."""
    table = dict(fleet.safety.settings)
    surveillance = table.pop("surveillance", {})
    if not isinstance(surveillance, dict):
        raise FleetError(f"safety.settings.surveillance: {surveillance!r}, must be a table")
    model = model_of(fleet, name)
    fence = Fence(fleet.volume.min_m, fleet.volume.max_m) if fleet.safety.geofence else None
    base = ArbiterLimits(
        lower=model.input_min,
        upper=model.input_max,
        floor_m=fleet.volume.min_m[2],
        surveillance=replaced(
            SurveillanceLimits(fence=fence, trust_repeated_poses=False),
            surveillance,
            "safety.settings.surveillance",
        ),
    )
    return replaced(base, table, "safety.settings")


def gateway_settings(fleet: Fleet, gateway: str, directory: Path) -> GatewaySettings:
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


def tracker_settings(fleet: Fleet) -> TrackerSettings:
    """Settings of the Vicon gateway process."""
    host, port = tracker_address(fleet)
    return TrackerSettings(
        bus=bus_address(fleet, fleet.tracker.host),
        host=host,
        port=port,
        subjects={vehicle.subject: name for name, vehicle in fleet.vehicles.items()},
        brand=brand_of(fleet),
        record_raw=raw_recording(fleet),
        realtime_priority=Priority.GATEWAY.of(fleet),
    )


def conditions_of(fleet: Fleet) -> Conditions:
    """Conditions of the simulated laboratory.

    Raises
    ------
    FleetError
        No simulator, unknown preset or field.
    """
    if fleet.simulator is None:
        raise FleetError("simulator: this fleet flies hardware, there is nothing to simulate")
    low, high = fleet.volume.min_m, fleet.volume.max_m
    # The radio link is emulated, so its delay must not be simulated a second time.
    fixed: dict[str, Any] = {
        "transport_delay_s": 0.0,
        "volume_min_m": (low[0], low[1], -0.1),
        "volume_max_m": high,
    }
    overrides = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in fleet.simulator.condition_overrides.items()
    }
    try:
        return conditions_from(fleet.simulator.conditions, fixed | overrides)
    except ValueError as error:
        raise FleetError(f"simulator.{error}") from None


def simulator_settings(fleet: Fleet, directory: Path) -> SimulatorSettings:
    """Settings of the simulator process."""
    conditions = conditions_of(fleet)
    simulator = fleet.simulator
    if simulator is None:
        raise FleetError("simulator: this fleet flies hardware, there is nothing to simulate")
    host, port = tracker_address(fleet)
    return SimulatorSettings(
        bus=bus_address(fleet, simulator.host),
        tracker_host=host,
        tracker_port=port,
        profile=simulator.profile,
        rate_hz=simulator.rate_hz,
        conditions=conditions,
        seed=simulator.seed,
        vehicles=tuple(_simulated(fleet, name, directory) for name in fleet.vehicles),
        realtime_priority=Priority.SIMULATOR.of(fleet),
    )


def _simulated(fleet: Fleet, name: str, directory: Path) -> SimulatedVehicle:
    vehicle = fleet.vehicles[name]
    start = {} if fleet.simulator is None else fleet.simulator.start
    x, y, _, yaw_rad = formation_place(fleet, name)
    place = start.get(name, (x, y, 0.0, yaw_rad))
    return SimulatedVehicle(
        name=name,
        subject=vehicle.subject,
        model=model_of(fleet, name),
        start=Pose(place[:3], place[3]),
        port=str(serial_path(vehicle.transmitter.port, directory)),
        radio=SimulatedRadio(protocol_of(fleet, name), vehicle.transmitter.model_match),
        calibration=calibration_of(vehicle, name),
    )


def check_fleet(fleet: Fleet, directory: Path) -> None:
    """Build the settings of every process, so that nothing is started from a file with a wrong field.

    Raises
    ------
    FleetError
        Names the field.
    """
    for name in fleet.vehicles:
        _check_period(fleet, name)
        pilot_of(fleet, name)
    first = next(iter(fleet.vehicles))
    check_formation(fleet, limits_of(fleet, first).surveillance.minimum_distance_m)
    for gateway in fleet.gateways:
        gateway_settings(fleet, gateway, directory)
    tracker_settings(fleet)
    if fleet.simulator is not None:
        simulator_settings(fleet, directory)


def pilot_of(fleet: Fleet, name: str) -> tuple[AgentSettings, "Pilot"]:
    """Settings and pilot of a vehicle's agent.

    Raises
    ------
    FleetError
        A field of the vehicle is wrong; controllers and estimators check their settings when they are built.
    """
    # Other roles start without the numerical libraries that pilots need.
    from agents.process import build_pilot

    settings = agent_settings(fleet, name)
    try:
        return settings, build_pilot(settings)
    except ValueError as error:
        raise FleetError(f"vehicles.{name}.control: {error}") from None


def _check_period(fleet: Fleet, name: str) -> None:
    """Agents are paced by their poses, so a control period is a whole number of frames."""
    if fleet.simulator is None:
        return
    period_s = fleet.vehicles[name].control.period_s
    frames = period_s * fleet.simulator.rate_hz
    if round(frames) < 1 or abs(frames - round(frames)) > 0.01:
        raise FleetError(
            f"vehicles.{name}.control.period_s: {period_s:g} s is no whole number of frames of "
            f"simulator.rate_hz = {fleet.simulator.rate_hz:g} Hz"
        )
