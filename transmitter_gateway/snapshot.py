"""State of a transmitter at one moment, and the frame that it has just written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from msgspec import Struct

from rcopterx.transmitter_gateway.inputs import ArbiterOutput, LinkState, State
from rcopterx.transmitter_gateway.port import WriteOutcome


class Write(Struct, frozen=True):
    """One attempt to write a frame: outcome, decision behind it, pulse widths in channel order."""

    time_s: float
    outcome: WriteOutcome
    output: ArbiterOutput
    pulses_us: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TransmitterSnapshot:
    """Everything a status message needs; `module` is the state of the module or the port's problem."""

    state: State
    reason: str
    link: LinkState
    module: str
    lease: int
    binding: bool
    bridging_step: int
    counters: Mapping[str, int]
