"""Radio protocols of a Multiprotocol module (protocol: DIY-Multiprotocol-TX-Module)."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import msgspec

from rcopterx.tables import table_beside


@dataclass(frozen=True, slots=True)
class MultiRadio:
    """One of the module's protocols."""

    number: int  # its number in a frame
    sub_protocols: tuple[str, ...]  # names of its sub-protocols, as the module reports them
    channels: int  # most channels on air
    autobind: bool = False  # whether the module binds whenever it begins to transmit, not only on request

    @property
    def taer(self) -> bool:
        """Whether the line has throttle, aileron, elevator, rudder (mapping off), else A, E, T, R."""
        return self.number == DSM


DSM: Final = 6
_TABLE: Final = table_beside(__file__, "multi_radios")
RADIOS: Final = MappingProxyType(msgspec.convert(_TABLE, dict[str, MultiRadio]))
"""Protocols by the name that the module reports, as far as vehicle types use them."""
