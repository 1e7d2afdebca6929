"""Everything the simulator process needs to know at start."""

from dataclasses import dataclass

from bus.session import BusAddress
from simulator.conditions import Conditions
from simulator.plant import Pose
from transmitter_gateway.calibration import Calibration
from vehicles.model import Model


@dataclass(frozen=True)
class SimulatedVehicle:
    """One vehicle of the fake laboratory.

    Attributes
    ----------
    subject
        Name in the emulated Tracker.
    port
        Path of the pseudo-terminal that stands for its radio module.
    protocol
        Radio protocol of the module.
    calibration
        How the vehicle's electronics read pulse widths.
    """

    name: str
    subject: str
    model: Model
    start: Pose
    port: str
    protocol: str
    model_match: int
    calibration: Calibration


@dataclass(frozen=True)
class SimulatorSettings:
    """The fake laboratory."""

    bus: BusAddress
    tracker_host: str
    tracker_port: int
    profile: str
    rate_hz: float
    conditions: Conditions
    seed: int
    vehicles: tuple[SimulatedVehicle, ...]
    realtime_priority: int = 0
