"""Radio protocols by the name used in the fleet file; each is imported when it is first used."""

from importlib import import_module
from typing import Any, Final, NamedTuple

from msgspec import convert

from rcopterx.radios.protocol import ProtocolError, RadioProtocol, SerialLine, check_choice
from rcopterx.tables import table_beside


class _Kind(NamedTuple):
    """Module of settings and line, class of the settings, and module and class of the protocol."""

    module: str
    settings: str
    protocol_module: str
    protocol: str
    missing_library: str = ""  # constant with the error if the protocol's library is an extra

    def of_settings(self, name: str) -> Any:
        return getattr(import_module(f"rcopterx.radios.{self.module}"), name)

    def protocol_class(self) -> type[Any]:
        """Class of the protocol; raises `ProtocolError` if its library is not installed."""
        try:
            module = import_module(f"rcopterx.radios.{self.protocol_module}")
        except ModuleNotFoundError as error:
            if not self.missing_library or (error.name or "").startswith("rcopterx"):
                raise
            raise ProtocolError(self.of_settings(self.missing_library)) from None
        kind: type[Any] = getattr(module, self.protocol)
        return kind


_KINDS: Final = convert(table_beside(__file__, "registry"), dict[str, _Kind])
PROTOCOL_NAMES: Final = tuple(_KINDS)


def default_line(name: str) -> SerialLine:
    """Serial line settings that a radio expects; raises `ProtocolError` if there is no such radio."""
    line: SerialLine = _kind(name).of_settings("LINE")
    return line


def settings_class(name: str) -> type[Any]:
    """Class of the options of a radio; raises `ProtocolError` if there is no such radio."""
    kind = _kind(name)
    settings: type[Any] = kind.of_settings(kind.settings)
    return settings


def create_protocol(name: str, settings: object = None, line: SerialLine | None = None) -> RadioProtocol:
    """Create a protocol with settings of its class, if any, and other `line` settings.

    Raises `ProtocolError`: there is no such radio, or its library is not installed.
    """
    radio: RadioProtocol = _kind(name).protocol_class()(settings, line or default_line(name))
    return radio


def _kind(name: str) -> _Kind:
    check_choice("protocol", name, _KINDS)
    return _KINDS[name]
