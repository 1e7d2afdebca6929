"""Everything the Vicon gateway process needs to know at start."""

from collections.abc import Mapping
from dataclasses import dataclass

from bus.session import BusAddress


@dataclass(frozen=True)
class TrackerSettings:
    """The motion capture to read.

    Attributes
    ----------
    host, port
        Address of the data stream.
    subjects
        Vehicle name by subject name.
    """

    bus: BusAddress
    host: str
    port: int
    subjects: Mapping[str, str]
    realtime_priority: int = 0
