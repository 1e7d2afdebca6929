"""One transmitter gateway process: its share of a core, and the time from command to serial frame."""

from __future__ import annotations

import multiprocessing
import os
import select
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from rcopterx.benchmarks.processes import cpu_s
from rcopterx.benchmarks.programs import Show
from rcopterx.bus import channels
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import Command, LeaseBid, Pose
from rcopterx.bus.requests import Arm
from rcopterx.bus.router import run_router
from rcopterx.bus.session import BusAddress, Session
from rcopterx.deploy.roles.run import end_with_parent
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.transmitter_gateway.calibration import Calibration
from rcopterx.transmitter_gateway.limits import ArbiterLimits
from rcopterx.transmitter_gateway.process import run_gateway
from rcopterx.transmitter_gateway.protocols.registry import create_protocol, default_line
from rcopterx.transmitter_gateway.settings import GatewaySettings, TransmitterSettings

PERIOD_S = 0.02
LEASE_S = 20.0
AGENT = 1
"""Number of the only agent."""
IDLE_S = 1.5
PLAN_STEPS = 6
NEXT_INPUTS = FloatArray.of(np.tile([0.0, 0.0, 0.55, 0.0], (PLAN_STEPS, 1)))
PRIORITY = 24


def run(transmitters: int = 8, seconds: float = 20.0, show: Show = lambda _: None) -> dict[str, Any]:
    """Measure one gateway process that flies emulated vehicles at 50 Hz.

    Returns
    -------
    dict
        `cpu_share` of one core, `write_ms` (median, p99, p999, max) from the arrival of a command in the
        process to its write, the number of `writes`, and the load of the machine.
    """
    names = [f"v{number}" for number in range(1, transmitters + 1)]
    with ExitStack() as stack:
        directory = Path(stack.enter_context(TemporaryDirectory(prefix="rcopterx-bench-")))
        endpoint = f"tcp/127.0.0.1:{_free_port()}"
        stack.enter_context(_process(run_router, [endpoint], [], None, PRIORITY + 2))
        address = BusAddress((endpoint,), "bench")
        stack.enter_context(_process(_serve_radios, [str(directory / name) for name in names]))
        session = stack.enter_context(Session(address, timeout_s=10.0))
        gateway = stack.enter_context(_process(_run_gateway, address, names, str(directory)))
        pilot = _Commander(session, names)
        show(f"{transmitters} transmitters, arming")
        _arm(pilot, session, names)
        pilot.fly(1.0, thrust=0.55)
        applied = [session.subscribe(channels.APPLIED, name, depth=int(seconds * 200)) for name in names]
        used_s, started_s, load = cpu_s(gateway), time.monotonic(), os.getloadavg()[0]
        show(f"measuring for {seconds:g} s")
        pilot.fly(seconds, thrust=0.55)
        elapsed_s = time.monotonic() - started_s
        used_s = cpu_s(gateway) - used_s
        written = [received.message for inbox in applied for received in inbox.drain()]
    delays_ms = np.array(
        [(m.written_s - m.command_arrived_s) * 1e3 for m in written if m.command_arrived_s is not None]
    )
    return {
        "transmitters": transmitters,
        "seconds": elapsed_s,
        "cpu_share": used_s / elapsed_s,
        "commands": pilot.sent * transmitters,
        "writes": len(delays_ms),
        "write_ms": {
            "median": float(np.median(delays_ms)),
            "p99": float(np.quantile(delays_ms, 0.99)),
            "p999": float(np.quantile(delays_ms, 0.999)),
            "max": float(delays_ms.max()),
        },
        "armed": all(message.state == "armed" for message in written),
        "load_before": load,
        "cores": os.cpu_count(),
    }


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def _process(target: Callable[..., None], *arguments: object) -> Iterator[int]:
    """A child process, which also ends when this one dies; yields its id."""
    process = multiprocessing.get_context("spawn").Process(
        target=_child, args=(os.getpid(), target, *arguments), daemon=True
    )
    process.start()
    try:
        yield int(process.pid or 0)
    finally:
        process.terminate()
        process.join(8)
        process.kill()


def _child(parent: int, target: Callable[..., None], *arguments: object) -> None:
    os.environ["RCOPTERX_PARENT"] = str(parent)
    end_with_parent()
    target(*arguments)


def _serve_radios(paths: list[str]) -> None:
    """Emulated modules, as the simulator serves them."""
    start_s = time.monotonic()
    radios = [RadioPty(path, RadioLink(MultiModule(start_s), Receiver(1))) for path in paths]
    while True:
        for radio in radios:
            radio.service(time.monotonic())
            radio.link.take_frames()
        select.select(radios, [], [], 0.004)


def _run_gateway(address: BusAddress, names: list[str], directory: str) -> None:
    line = replace(default_line("multi"), parity="N")
    run_gateway(
        GatewaySettings(
            bus=address,
            name="transmitters",
            transmitters=tuple(
                TransmitterSettings(
                    vehicle=name,
                    port=f"{directory}/{name}",
                    protocol=create_protocol("multi", {"rx_num": 1}, line),
                    calibration=Calibration(),
                    limits=ArbiterLimits(),
                )
                for name in names
            ),
            vehicles=tuple(names),
            realtime_priority=PRIORITY,
        )
    )


class _Commander:
    """Publishes poses of all vehicles, then commands of all, at 50 Hz."""

    def __init__(self, session: Session, names: list[str]) -> None:
        self._session = session
        self._names = names
        self._frame = 0
        self._leases = _leases(session, names)
        self.sent = 0

    def fly(self, seconds: float, thrust: float) -> None:
        self.sent = 0
        next_s = time.monotonic()
        end_s = next_s + seconds
        while next_s < end_s:
            time.sleep(max(0.0, next_s - time.monotonic()))
            next_s += PERIOD_S
            self._frame += 1
            self.sent += 1
            for number, name in enumerate(self._names):
                self._session.publish(
                    channels.POSE,
                    name,
                    Pose(
                        epoch=1, frame=self._frame, period_s=PERIOD_S,
                        latency_s=0.0, received_s=0.0, occluded=False,
                        position_m=(float(number), 0.0, 1.0), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0),
                    ),
                )  # fmt: skip
            for name in self._names:
                self._session.publish(
                    channels.COMMAND,
                    name,
                    Command(
                        epoch=1, frame=self._frame, lease=self._leases[name], sequence=self._frame,
                        input=(0.0, 0.0, thrust, 0.0), next_inputs=NEXT_INPUTS, period_s=PERIOD_S,
                    ),
                )  # fmt: skip


def _leases(session: Session, names: list[str]) -> dict[str, int]:
    """Control leases of all vehicles."""
    answers = {name: session.subscribe(channels.LEASE, name, depth=8) for name in names}
    leases: dict[str, int] = {}
    give_up_s = time.monotonic() + LEASE_S
    while len(leases) < len(names):
        if time.monotonic() > give_up_s:
            raise RuntimeError("the transmitter gateway issues no leases")
        for name in names:
            session.publish(channels.LEASE_BID, name, LeaseBid(agent=AGENT))
        time.sleep(PERIOD_S)
        leases |= {
            name: received.message.number
            for name, inbox in answers.items()
            for received in inbox.drain()
            if received.message.number
        }
    return leases


def _arm(pilot: _Commander, session: Session, names: list[str]) -> None:
    give_up_s = time.monotonic() + 20.0
    waiting = list(names)
    while waiting:
        pilot.fly(IDLE_S if len(waiting) == len(names) else 0.2, thrust=0.0)
        reply = session.request(waiting[0], Arm(), patience_s=10.0)
        if reply.accepted:
            waiting.pop(0)
        elif time.monotonic() > give_up_s:
            raise RuntimeError(f"{waiting[0]} cannot be armed: {reply.reason}")
