"""The role of the Vicon gateway: address, brand and raw recording of the motion capture."""

from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec

from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.schema import FleetError, FleetFile, TrackerConfig, check_known, errors_at
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.fleet.vehicle_types import type_of
from rcopterx.user_text import TextError, host_and_port
from rcopterx.vicon_gateway.client import LibraryMissingError
from rcopterx.vicon_gateway.process import TrackerSettings, run_tracker_gateway
from rcopterx.vicon_gateway.recording import RecordingFileError, check_creatable

if TYPE_CHECKING:
    from rcopterx.vicon_gateway.brands import BrandSettings  # a Vicon Tracker needs no other brand
    from rcopterx.vicon_gateway.external_poses import PoseLink
    from rcopterx.vicon_gateway.subject_plans import SubjectPlans

OWN_CLIENT: Final = "vicon"


class Brand(msgspec.Struct, frozen=True):
    """A row of `brands.toml`, which describes the fields."""

    text: str = ""
    port: int | None = None
    library: str | None = None
    options: dict[str, str] = {}
    simulated: bool = False


BRANDS: Final = msgspec.toml.decode((files(__package__) / "brands.toml").read_bytes(), type=dict[str, Brand])
USUAL_PORTS: Final = {name: brand.port for name, brand in BRANDS.items() if brand.port is not None}


def run(fleet: FleetFile, _host: str) -> None:
    """Publish the poses of the motion capture; raises `FleetError`."""
    with errors_at("tracker.record_raw", RecordingFileError), errors_at("tracker.brand", LibraryMissingError):
        run_tracker_gateway(tracker_settings(fleet))


def tracker_settings(fleet: FleetFile) -> TrackerSettings:
    """Return the settings of the Vicon gateway process."""
    host, port = tracker_address(fleet)
    return TrackerSettings(
        bus=bus_address(fleet, fleet.tracker.host, "tracker"),
        host=host,
        port=port,
        subjects={subject: name for name, subject in fleet.tracked.items()},
        brand=brand_of(fleet),
        record_raw=raw_recording(fleet),
        realtime_priority=Priority.GATEWAY.of(fleet),
        pose_links=_pose_links(fleet),
        subject_plans=_subject_plans(fleet) if fleet.subjects else None,
    )


def _subject_plans(fleet: FleetFile) -> "partial[SubjectPlans]":
    """Return what plans for subjects that are no vehicles, within what every vehicle can follow."""
    # Numerical libraries, which other Vicon gateways do not need.
    from rcopterx.vicon_gateway.subject_plans import SubjectPlans

    margins_m = {name: subject.margin_m for name, subject in fleet.subjects.items()}
    speeds = [model_of(fleet, name).state_max[3:] for name in fleet.vehicles]
    fastest = [min(rates) for rates in zip(*speeds, strict=True)]
    period_s = min(vehicle.control.period_s for vehicle in fleet.vehicles.values())
    return partial(SubjectPlans, margins_m, fastest, period_s)


def _pose_links(fleet: FleetFile) -> "dict[str, PoseLink]":
    """Return the links of autopilots that get their poses from the Vicon gateway, by vehicle."""
    tables = {
        name: type_of(fleet, name).file.transmitter.settings | vehicle.transmitter.settings
        for name, vehicle in fleet.vehicles.items()
    }
    wanted = [name for name, table in tables.items() if table.get("pose_port")]
    if not wanted:
        return {}
    # Their library is an extra.
    from rcopterx.fleet.radios import protocol_of
    from rcopterx.radios.mavlink import MavlinkProtocol
    from rcopterx.radios.udp import udp_address
    from rcopterx.vicon_gateway.external_poses import PoseLink

    radios = {name: protocol_of(fleet, name) for name in wanted}
    return {
        name: PoseLink(udp_address(radio.settings.pose_port), radio.settings.system)
        for name, radio in radios.items()
        if isinstance(radio, MavlinkProtocol)
    }


def tracker_address(fleet: FleetFile) -> tuple[str, int]:
    """Return host and port of the Tracker; `FleetError` if the address is not HOST:PORT."""
    with errors_at("tracker.address", TextError):
        return host_and_port(fleet.tracker.address)


def brand_of(fleet: FleetFile) -> "BrandSettings | None":
    """Return the settings of another brand, None for a Vicon Tracker; `FleetError` for a wrong field."""
    tracker = fleet.tracker
    brand = tracker.brand
    check_known("tracker.brand", "brand", brand, BRANDS)
    if fleet.simulator is not None and not BRANDS[brand].simulated:
        allowed = ", ".join(name for name, row in BRANDS.items() if row.simulated)
        raise FleetError(f"tracker.brand: {brand!r}, the simulator is a Vicon Tracker: allowed are {allowed}")
    if brand == OWN_CLIENT:
        for name in ("rate_hz", "latency_s"):
            if getattr(tracker, name) is not None:
                raise FleetError(f"tracker.{name}: a Vicon Tracker reports it itself, leave it out")
        if tracker.settings:
            raise FleetError("tracker.settings: are for the other brands, leave them out")
        return None
    if tracker.record_raw is not None:
        raise FleetError(f"tracker.record_raw: only the stream of brand {OWN_CLIENT!r} can be recorded")
    if tracker.rate_hz is None:
        raise FleetError(f"tracker.rate_hz: is missing, brand {brand!r} does not report its capture rate")
    if brand in USUAL_PORTS and tracker.address == TrackerConfig().address:
        usual = f"HOST:{USUAL_PORTS[brand]}"
        raise FleetError(f"tracker.address: is missing, for brand {brand!r} it is {usual} as a rule")
    from rcopterx.vicon_gateway.brands import BrandSettings

    (host, port), row = tracker_address(fleet), BRANDS[brand]
    addressed = {name: text.format(host=host, port=port) for name, text in row.options.items()}
    settings = addressed | tracker.settings
    with errors_at("tracker.settings", ValueError):
        return BrandSettings(row.library or brand, settings, tracker.rate_hz, tracker.latency_s or 0.0)


def raw_recording(fleet: FleetFile) -> Path | None:
    """Return the file that the Tracker's stream is recorded into, if any."""
    record_raw = fleet.tracker.record_raw
    return None if record_raw is None else Path(record_raw).expanduser()


def check_motion_capture(fleet: FleetFile) -> None:
    """Check the library of the brand and that the recording can be created; `FleetError` names the field."""
    if brand_of(fleet) is not None:
        from rcopterx.vicon_gateway.brands import check_library

        with errors_at(f"tracker.brand: {fleet.tracker.brand!r}", LibraryMissingError):
            check_library()
    if (path := raw_recording(fleet)) is not None:
        with errors_at("tracker.record_raw", RecordingFileError):
            check_creatable(path)
