"""Radio protocols by the name used in the fleet file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcopterx.radios import crazyflie, dsm2_serial, dsmp, mavlink_settings, multi, ppm
from rcopterx.radios.protocol import ProtocolError, RadioProtocol, SerialLine, check_choice


def _mavlink(settings: mavlink_settings.MavlinkSettings | None, line: SerialLine) -> RadioProtocol:
    """Create the protocol whose library is an extra; raises `ProtocolError` without it."""
    try:
        from rcopterx.radios.mavlink import MavlinkProtocol
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


def create_protocol(name: str, settings: object = None, line: SerialLine | None = None) -> RadioProtocol:
    """Create a protocol with settings of its class, if any, and other `line` settings.

    Raises `ProtocolError`: there is no such radio, or its library is not installed.
    """
    _, create, own_line = _kind(name)
    return create(settings, line or own_line)


def _kind(name: str) -> tuple[type[Any], Callable[..., RadioProtocol], SerialLine]:
    check_choice("protocol", name, _KINDS)
    return _KINDS[name]
