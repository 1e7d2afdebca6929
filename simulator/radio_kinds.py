"""Emulated radio modules by the name of their protocol, and their faults."""

from collections.abc import Callable
from typing import Final

from rcopterx.simulator.radio import RadioPty
from rcopterx.simulator.radio_boards import Dsm2Board, DsmpModule, TrainerTransmitter
from rcopterx.simulator.radio_module import RadioModule
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.settings import SimulatedRadio
from rcopterx.transmitter_gateway.protocols.multi import MultiProtocol
from rcopterx.transmitter_gateway.protocols.ppm import PpmGenProtocol


def _multi(radio: SimulatedRadio, start_s: float) -> RadioModule:
    wired_inverted = not isinstance(radio.protocol, MultiProtocol) or radio.protocol.settings.inverted_line
    return MultiModule(start_s, inverted_wiring=wired_inverted)


def _trainer(radio: SimulatedRadio, start_s: float) -> RadioModule:
    settings = radio.protocol.settings if isinstance(radio.protocol, PpmGenProtocol) else None
    return TrainerTransmitter(settings, model_match=radio.model_match, powered_s=start_s)


_MODULES: Final[dict[str, Callable[[SimulatedRadio, float], RadioModule]]] = {
    "multi": _multi,
    "dsm2_serial": lambda _, start_s: Dsm2Board(start_s),
    "dsmp": lambda _, start_s: DsmpModule(start_s),
    "ppm": _trainer,
}


def module_of(radio: SimulatedRadio, start_s: float) -> RadioModule:
    """Module for a vehicle's transmitter protocol, wired and set as it expects, switched on at `start_s`."""
    return _MODULES[radio.protocol.name](radio, start_s)


def condition_refused(radio: RadioPty, condition: str) -> str | None:
    """Why a module cannot be brought into a condition; None if it can. See `set_condition`."""
    if condition == "refusing" and not isinstance(radio.link.module, MultiModule):
        return "only a Multiprotocol module tells that it does not know the protocol"
    return None


def set_condition(radio: RadioPty, condition: str, now_s: float) -> None:
    """Break or repair the radio module behind a pseudo-terminal while the laboratory runs.

    `condition` is `ready`; `unplugged`: the cable, which also feeds the module, is pulled; `adapter`: the
    adapter is gone, the module has power; `off`: the adapter is there, the module has no
    power; `refusing`: a Multiprotocol module whose firmware has no DSM2.
    """
    module = radio.link.module
    if isinstance(module, MultiModule):
        module.knows_dsm2 = condition != "refusing"
    if condition in ("unplugged", "adapter"):
        radio.unplug(powered=condition == "adapter")
        return
    radio.replug(now_s)
    if condition == "off":
        radio.switch_off()
    else:
        radio.switch_on(now_s)
