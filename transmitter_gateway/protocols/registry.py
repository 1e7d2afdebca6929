"""Radio protocols by the name used in the fleet file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from rcopterx.transmitter_gateway.protocols import crazyflie, dsm2_serial, dsmp, multi, ppm
from rcopterx.transmitter_gateway.protocols.base import ProtocolError, RadioProtocol, SerialLine

_KINDS: dict[str, tuple[type[Any], Callable[..., RadioProtocol], SerialLine]] = {
    "multi": (multi.MultiSettings, multi.MultiProtocol, multi.LINE),
    "dsm2_serial": (dsm2_serial.Dsm2Settings, dsm2_serial.Dsm2SerialProtocol, dsm2_serial.LINE),
    "dsmp": (dsmp.DsmpSettings, dsmp.DsmpProtocol, dsmp.LINE),
    "crazyflie": (crazyflie.CrazyflieSettings, crazyflie.CrazyflieProtocol, crazyflie.LINE),
    "ppm": (ppm.PpmSettings, ppm.PpmGenProtocol, ppm.PPM_GEN_LINE),
    "sc8000p": (ppm.PpmSettings, ppm.Sc8000pProtocol, ppm.SC8000P_LINE),
}
PROTOCOL_NAMES = tuple(_KINDS)


def default_line(name: str) -> SerialLine:
    """Serial line settings that a radio expects; raises `ProtocolError` if there is no such radio."""
    return _kind(name)[2]


def settings_class(name: str) -> type[Any]:
    """Class of the options of a radio; raises `ProtocolError` if there is no such radio."""
    return _kind(name)[0]


def create_protocol(
    name: str, options: Mapping[str, object] | None = None, line: SerialLine | None = None
) -> RadioProtocol:
    """Create a protocol of `PROTOCOL_NAMES`.

    `options` are fields of its settings class, `line` line settings other than the radio's own. Raises
    `ProtocolError` for an unknown radio or option, or a value that is not allowed.
    """
    settings_class, protocol_class, own_line = _kind(name)
    allowed = {item.name: type(item.default) for item in fields(settings_class)}
    for key, value in (options or {}).items():
        if key not in allowed:
            raise ProtocolError(f"{name}.{key}: unknown option, known are {', '.join(allowed)}")
        if type(value) is not allowed[key]:
            raise ProtocolError(f"{name}.{key}: {value!r} must be of type {allowed[key].__name__}")
    return protocol_class(settings_class(**(options or {})), line or own_line)


def _kind(name: str) -> tuple[type[Any], Callable[..., RadioProtocol], SerialLine]:
    if name not in _KINDS:
        raise ProtocolError(f"protocol: {name!r} is unknown, choose one of {', '.join(_KINDS)}")
    return _KINDS[name]
