"""Everything the Vicon gateway process needs to know at start."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rcopterx.bus.session import BusAddress


@dataclass(frozen=True)
class BrandSettings:
    """A motion capture that is read by the library `motioncapture`; see `brands.BrandClient`."""

    brand: str
    options: Mapping[str, str]
    rate_hz: float
    latency_s: float


@dataclass(frozen=True)
class TrackerSettings:
    """Motion capture to read: subjects with their vehicles, and where to record the raw stream, if anywhere.

    `brand` is None for a Vicon Tracker, read by our own client. An existing recording is not overwritten.
    """

    bus: BusAddress
    host: str
    port: int
    subjects: Mapping[str, str]
    brand: BrandSettings | None = None
    record_raw: Path | None = None
    realtime_priority: int = 0
