"""Emulated radio modules by the name of their protocol, and their faults."""

from rcopterx.radios.crazyflie import CrazyflieProtocol
from rcopterx.radios.dsm2_serial import Dsm2SerialProtocol
from rcopterx.radios.dsmp import DsmpProtocol
from rcopterx.radios.multi import MultiProtocol
from rcopterx.radios.ppm import PpmGenProtocol
from rcopterx.radios.set_points import SetPointRadio
from rcopterx.radios.udp import UDP, udp_address
from rcopterx.simulator.crazyflie import Crazyflie
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_boards import Dsm2Board, DsmpModule, TrainerTransmitter
from rcopterx.simulator.radio_module import RadioEnd, RadioModule
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.simulator.settings import SimulatedRadio
from rcopterx.simulator.vehicle_udp import UdpVehicle, VehicleOnAir, VehicleUdp


def module_of(radio: SimulatedRadio, start_s: float) -> RadioModule:
    """Module for a transmitter protocol, set as it expects, on at `start_s`; else `ValueError`."""
    match radio.protocol:
        case MultiProtocol(settings=settings):
            return MultiModule(start_s, inverted_wiring=settings.inverted_line)
        case Dsm2SerialProtocol():
            return Dsm2Board(start_s)
        case DsmpProtocol():
            return DsmpModule(start_s)
        case PpmGenProtocol(settings=settings):
            return TrainerTransmitter(settings, model_match=radio.model_match, powered_s=start_s)
    raise ValueError(f"{radio.protocol.name}: no module is emulated")


def radio_end_of(port: str, radio: SimulatedRadio, start_s: float, brushless: bool = False) -> RadioEnd:
    """Emulated radio of a vehicle at a port; raises `OSError` if the port cannot be used."""
    if isinstance(radio.protocol, SetPointRadio):
        vehicle = _vehicle_of(radio.protocol, start_s, brushless)
        return VehicleUdp(udp_address(port), vehicle) if port.startswith(UDP) else VehicleOnAir(port, vehicle)
    return RadioPty(port, RadioLink(module_of(radio, start_s), Receiver(radio.model_match)))


def _vehicle_of(protocol: SetPointRadio, start_s: float, brushless: bool) -> UdpVehicle:
    if isinstance(protocol, CrazyflieProtocol):
        return Crazyflie(protocol.settings, start_s, arms_itself=not brushless)
    # Its library is an extra.
    from rcopterx.radios.mavlink import MavlinkProtocol
    from rcopterx.simulator.autopilot import EmulatedAutopilot

    if isinstance(protocol, MavlinkProtocol):
        return EmulatedAutopilot(protocol.settings, start_s)
    raise ValueError(f"{protocol.name}: no vehicle is emulated")


def _multi_module(radio: RadioEnd) -> MultiModule | None:
    module = radio.link.module if isinstance(radio, RadioPty) else None
    return module if isinstance(module, MultiModule) else None


def condition_refused(radio: RadioEnd, condition: str) -> str | None:
    """Why a radio cannot be brought into a condition; None if it can. See `set_condition`."""
    if condition == "refusing" and _multi_module(radio) is None:
        return "only a Multiprotocol module reports that it does not know the protocol"
    return None


def set_condition(radio: RadioEnd, condition: str, now_s: float) -> None:
    """Break or repair a radio: `ready`, `unplugged` (cable), `adapter`, `off` (power), or `refusing` DSM2.

    A Crazyflie keeps its battery without the adapter, and loses it with `off`.
    """
    if (module := _multi_module(radio)) is not None:
        module.knows_dsm2 = condition != "refusing"
    if condition in ("unplugged", "adapter"):
        radio.unplug(powered=condition == "adapter")
        return
    radio.replug(now_s)
    if condition == "off":
        radio.switch_off()
    else:
        radio.switch_on(now_s)
