"""Tables of the fleet file about the laboratory: flight volume, motion capture, simulator."""

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

Name = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_]{0,30}$")]
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Positive = Annotated[float, Meta(gt=0)]
Text = Annotated[str, Meta(min_length=1)]

DEFAULT_HOST = "main"


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the fleet file."""


class Volume(Table, frozen=True, kw_only=True):
    """Flight volume in the inertial frame."""

    min_m: Three = (-1.2, -1.2, 0.0)
    max_m: Three = (1.2, 1.2, 2.0)


class Tracker(Table, frozen=True, kw_only=True):
    """The motion capture."""

    host: Name = DEFAULT_HOST
    """Host that runs the gateway."""
    address: str = "127.0.0.1:801"
    """Address and port of the Tracker's data stream, or of the motion capture of another brand."""
    brand: str = "vicon"
    """`vicon` is read by our own client, the others (`vicon_sdk` too) by the library `motioncapture`."""
    rate_hz: Annotated[float, Meta(gt=0, le=2000)] | None = None
    """Capture rate of a motion capture that does not tell it."""
    latency_s: Annotated[float, Meta(ge=0, le=1)] | None = None
    """From capture to arrival, of a motion capture that does not tell it."""
    settings: dict[str, str] = field(default_factory=dict)
    """Further settings of the library, spelt as it spells them."""
    record_raw: Text | None = None
    """File to record the raw stream into; relative to where the gateway is started."""


class Simulator(Table, frozen=True, kw_only=True):
    """The fake laboratory. Leave this table out to fly hardware."""

    host: Name = DEFAULT_HOST
    rate_hz: Annotated[float, Meta(ge=20, le=400)] = 50.0
    profile: Literal["tracker1", "tracker2", "tracker3"] = "tracker3"
    seed: Annotated[int, Meta(ge=0)] = 0
    conditions: str = "laboratory"
    """Name of a preset: `ideal` or `laboratory`."""
    condition_overrides: dict[str, Any] = {}
    """Single values that differ from the preset."""
    start: dict[Name, Four] = {}
    """Where vehicles stand at first: x, y, z [m], yaw [rad]. Default: their place in the formation."""
