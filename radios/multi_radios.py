"""Radio protocols of a Multiprotocol module (protocol: DIY-Multiprotocol-TX-Module)."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final


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
RADIOS: Final = MappingProxyType(
    {
        "DSM": MultiRadio(DSM, ("2 1F", "2 2F", "X 1F", "X 2F"), 12),
        "SLT": MultiRadio(
            11, ("V1_6ch", "V2_8ch", "Q100", "Q200", "MR100", "V1_4ch", "RF_SIM", "SLT6TX"), 13, True
        ),
        "FrSky D": MultiRadio(3, ("D8", "Cloned"), 8),
        "FrSky X": MultiRadio(15, ("D16", "D16 8ch", "LBT(EU)", "LBT 8ch", "Cloned", "Clo 8ch"), 16),
        "FlSky2A": MultiRadio(28, ("PWM,IBUS", "PPM,IBUS", "PWM,SBUS", "PPM,SBUS"), 16),
        "CFlie": MultiRadio(38, ("",), 4),
        "V911S": MultiRadio(46, ("V911S", "E119"), 9),
        "EskyV2": MultiRadio(69, ("150V2",), 16),
        "OMP": MultiRadio(77, ("",), 7),
        "E129": MultiRadio(83, ("E129", "C186"), 12, True),
    }
)
"""Protocols by the name that the module reports, as far as vehicle types use them."""
