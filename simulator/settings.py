"""Everything the simulator process needs to know at start."""

from dataclasses import dataclass

from rcopterx.bus.session import BusAddress
from rcopterx.radios.calibration import Calibration
from rcopterx.radios.protocol import RadioProtocol
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.model import Model


@dataclass(frozen=True)
class SimulatedRadio:
    """A radio module for a transmitter protocol, and the number of the receiver bound to it."""

    protocol: RadioProtocol
    model_match: int


@dataclass(frozen=True)
class SimulatedVehicle:
    """A vehicle, its subject, start pose, port of its radio, and how it reads pulse widths."""

    name: str
    subject: str
    model: Model
    start: BodyPose
    port: str
    radio: SimulatedRadio
    calibration: Calibration


@dataclass(frozen=True)
class SimulatorSettings:
    """The simulated laboratory."""

    bus: BusAddress
    tracker_host: str
    tracker_port: int
    profile: str
    rate_hz: float
    conditions: Conditions
    seed: int
    vehicles: tuple[SimulatedVehicle, ...]
    realtime_priority: int = 0
