"""Radio protocols by the name used in the fleet file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from rcopterx.transmitter_gateway.protocols import (
    crazyflie,
    dsm2_serial,
    dsmp,
    mavlink_settings,
    multi,
    ppm,
)
from rcopterx.transmitter_gateway.protocols.base import ProtocolError, RadioProtocol, SerialLine


def _mavlink(settings: mavlink_settings.MavlinkSettings, line: SerialLine) -> RadioProtocol:
    """Create the protocol whose library is an extra; raises `ProtocolError` without it."""
    try:
        from rcopterx.transmitter_gateway.protocols.mavlink import MavlinkProtocol
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("rcopterx"):
            raise
        raise ProtocolError(mavlink_settings.MISSING_LIBRARY) from None
    return MavlinkProtocol(settings, line)


_KINDS: dict[str, tuple[type[Any], Callable[..., RadioProtocol], SerialLine]] = {
    "multi": (multi.MultiSettings, multi.MultiProtocol, multi.LINE),
    "dsm2_serial": (dsm2_serial.Dsm2Settings, dsm2_serial.Dsm2SerialProtocol, dsm2_serial.LINE),
    "dsmp": (dsmp.DsmpSettings, dsmp.DsmpProtocol, dsmp.LINE),
    "crazyflie": (crazyflie.CrazyflieSettings, crazyflie.CrazyflieProtocol, crazyflie.LINE),
    "mavlink": (mavlink_settings.MavlinkSettings, _mavlink, mavlink_settings.LINE),
    "ppm": (ppm.PpmSettings, ppm.PpmGenProtocol, ppm.LINE),
}
PROTOCOL_NAMES = tuple(_KINDS)


def default_line(name: str) -> SerialLine:
    """Serial line settings that a radio expects; raises `ProtocolError` if there is no such radio."""
    return _kind(name)[2]


def settings_class(name: str) -> type[Any]:
    """Class of the options of a radio; raises `ProtocolError` if there is no such radio."""
    return _kind(name)[0]


def settings_of(name: str, options: Mapping[str, object]) -> Any:
    """Return the settings of a protocol with some fields; `ProtocolError` for what is not allowed."""
    kind = settings_class(name)
    allowed = {item.name: type(item.default) for item in fields(kind)}
    for key, value in options.items():
        if key not in allowed:
            raise ProtocolError(f"{name}.{key}: unknown option, known are {', '.join(allowed)}")
        if type(value) is not allowed[key]:
            raise ProtocolError(f"{name}.{key}: {value!r} must be of type {allowed[key].__name__}")
    return kind(**options)


def create_protocol(
    name: str, options: Mapping[str, object] | None = None, line: SerialLine | None = None
) -> RadioProtocol:
    """Create a protocol with options and other `line` settings; raises `ProtocolError`."""
    settings = settings_of(name, options or {})
    _, create, own_line = _kind(name)
    return create(settings, line or own_line)


def _kind(name: str) -> tuple[type[Any], Callable[..., RadioProtocol], SerialLine]:
    if name not in _KINDS:
        raise ProtocolError(f"protocol: {name!r} is unknown, choose one of {', '.join(_KINDS)}")
    return _KINDS[name]
