"""The workbench of a radio is ready with its module, whatever the vehicle needs before it flies."""

import select
from collections.abc import Sequence
from pathlib import Path

import pytest
from support.radios import serve
from support.waiting import wait_for

from rcopterx.radios.calibration import ArmingChannel, Calibration
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.radios.multi import MultiProtocol, MultiSettings
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.transmitter_gateway.serial_port import SerialLine, SerialPort
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.workbench import Workbench

STEP_S = 0.002


@pytest.mark.parametrize("arming", [None, ArmingChannel(4)])
def test_the_workbench_does_not_wait_for_a_receiver(tmp_path: Path, arming: ArmingChannel | None) -> None:
    line = SerialLine(100_000, "N", 2)
    radio = RadioPty(tmp_path / "radio", RadioLink(MultiModule(0.0), Receiver(3)))
    now_s = 0.0

    def wait(descriptors: Sequence[int], timeout_s: float) -> Sequence[int]:
        nonlocal now_s
        wait_for(lambda: not port.is_opening, "the port does not open")
        now_s += min(timeout_s, STEP_S)
        serve(radio, now_s)
        return select.select(descriptors, [], [], 0)[0]

    settings = TransmitterSettings(
        "h1",
        str(radio.path),
        MultiProtocol(MultiSettings(rx_num=3), line),
        Calibration(arming=arming),
        ArbiterLimits(),
    )
    with Workbench(settings, lambda: now_s, wait) as bench:
        port = bench.transmitter.port
        assert isinstance(port, SerialPort)
        assert "ready" in bench.wait_ready(limit_s=2.0)
        assert now_s < 2.0
    radio.unplug()
