"""Everything one transmitter gateway process needs to know at start."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rcopterx.bus.session import BusAddress
from rcopterx.radios.battery import NO_LIMITS, BatteryLimits
from rcopterx.radios.calibration import Calibration
from rcopterx.radios.crazyradio import UsbDevice, find_dongle
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.protocol import RadioProtocol


@dataclass(frozen=True)
class TransmitterSettings:
    """One vehicle's transmitter; `port` is its serial device or address."""

    vehicle: str
    port: str
    protocol: RadioProtocol
    calibration: Calibration
    limits: ArbiterLimits
    battery: BatteryLimits = NO_LIMITS
    low_power: bool = False


@dataclass(frozen=True)
class GatewaySettings:
    """One gateway process with its transmitters."""

    bus: BusAddress
    transmitters: tuple[TransmitterSettings, ...]
    vehicles: tuple[str, ...]  # all whose poses matter
    states: Path  # directory of the pages with the states of its vehicles, for its successor
    realtime_priority: int = 0
    dongles: Callable[[int], UsbDevice] = find_dongle  # returns a Crazyradio by its number
