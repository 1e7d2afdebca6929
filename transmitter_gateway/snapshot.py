"""What a transmitter tells about itself: the frame it has just written, and its state at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from msgspec import Struct

from rcopterx.transmitter_gateway.inputs import ArbiterOutput, LinkState, State
from rcopterx.transmitter_gateway.serial_port import WriteOutcome


class Write(Struct, frozen=True):
    """One attempt to write a frame: when, what became of it, what the frame carried and why.

    Parameters
    ----------
    time_s : float
        Local time of the write [s].
    outcome : WriteOutcome
        Whether the frame went out.
    output : ArbiterOutput
        Decision behind the frame, with the applied inputs and the command's identity.
    pulses_us : tuple of float
        Pulse widths in channel order [us].
    """

    time_s: float
    outcome: WriteOutcome
    output: ArbiterOutput
    pulses_us: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TransmitterSnapshot:
    """Everything a status message needs, at one moment.

    Parameters
    ----------
    state, reason
        Of the arbiter.
    link : LinkState
        Port and module.
    module : str
        The module, or what is wrong with the port, as text.
    lease : int
        Control lease whose commands count; 0 before the first command.
    binding : bool
        Bind frames are being sent.
    bridging_step : int
        Planned input being played, 0 for none.
    counters : mapping
        Every counter of arbiter and port by name.
    """

    state: State
    reason: str
    link: LinkState
    module: str
    lease: int
    binding: bool
    bridging_step: int
    counters: Mapping[str, int]
