"""Everything the Vicon gateway process needs to know at start."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

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
    record_raw
        Where to record the raw stream, None for nowhere; a file that is there is not overwritten.
    """

    bus: BusAddress
    host: str
    port: int
    subjects: Mapping[str, str]
    record_raw: Path | None = None
    realtime_priority: int = 0
