"""Latency from pose to command over four hosts (network namespaces) with TLS, against one host."""

import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import tomlkit

from rcopterx.bus import channels
from rcopterx.bus.messages import Applied
from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.benchmarks.namespaces import network
from rcopterx_studies.benchmarks.processes import Show
from rcopterx_studies.benchmarks.scale import fly_legs
from rcopterx_studies.environment import environment_with

LABORATORY: Final = "main"  # host of the simulated laboratory and its gateways
ONE: Final[Mapping[str, str]] = {"h1": "main", "h2": "main", "h3": "main"}
FOUR: Final[Mapping[str, str]] = {"h1": "compute1", "h2": "compute2", "h3": "compute3"}
"""Host of each vehicle's agent."""
ROUTER_PORT: Final = 7447
TRACKER_PORT: Final = 8010
FIRST_ROUTER_S: Final = 180.0  # limit that includes compiling the kernels
READY_S: Final = 60.0
SETTLE_S: Final = 5.0
STAGES: Final = ("pose to agent", "until the controller begins", "control", "command to transmitters")
"""Stages from pose to command; the second one is estimation and the wait for the leader's plan."""

Commands = list[tuple[int, tuple[float, ...]]]  # of the applied commands, with ends of their `STAGES`


def run(rounds: int, seconds: float, show: Show) -> dict[str, Any]:
    """Fly the trio on one host and over four in turn, `rounds` times.

    Returns `one_host` and `four_hosts`: `pose_to_command_ms` (p50, p99, max), `stages_ms` of it (see
    `STAGES`) and control periods `missed` of `periods`; `ratio_p99`; the `load` of the machine before. Raises
    `NetworkUnavailableError`: network namespaces cannot be created.
    """
    load = os.getloadavg()[0]
    flown: dict[str, list[Commands]] = {"one_host": [], "four_hosts": []}
    for number in range(rounds):
        for name, agents, certificates in (("one_host", ONE, False), ("four_hosts", FOUR, True)):
            show(f"round {number + 1}: {name.replace('_', ' ')}")
            flown[name] += _flown(agents, certificates, seconds)
    document = {name: _figures(vehicles) for name, vehicles in flown.items()}
    p99_ms = [document[name]["pose_to_command_ms"]["p99"] for name in ("four_hosts", "one_host")]
    return {**document, "ratio_p99": p99_ms[0] / p99_ms[1], "load": load}


def _times_s(applied: Applied) -> tuple[float, ...] | None:
    """Beginnings and ends of the `STAGES` of an applied command; None if they are not known."""
    timing = applied.timing
    if timing is None or applied.command_arrived_s is None:
        return None
    return (timing.received_s, timing.arrived_s, timing.began_s, timing.ready_s, applied.command_arrived_s)


def _figures(vehicles: Sequence[Commands]) -> dict[str, Any]:
    times_ms = 1e3 * np.array([times_s for commands in vehicles for _, times_s in commands])
    stages_ms = np.diff(times_ms, axis=1)
    frames = [{frame for frame, _ in commands} for commands in vehicles]
    periods = sum(max(flown) - min(flown) + 1 for flown in frames)
    return {
        "pose_to_command_ms": percentiles((times_ms[:, -1] - times_ms[:, 0]).tolist()),
        "stages_ms": {
            name: percentiles(stage_ms.tolist()) for name, stage_ms in zip(STAGES, stages_ms.T, strict=True)
        },
        "missed": periods - sum(map(len, frames)),
        "periods": periods,
    }


def _flown(agents: Mapping[str, str], certificates: bool, seconds: float) -> list[Commands]:
    hosts = list(dict.fromkeys((LABORATORY, *agents.values())))
    with ExitStack() as stack:
        # A short path, because the routers' sockets live in it.
        directory = Path(stack.enter_context(TemporaryDirectory(prefix="rcopterx-")))
        net = stack.enter_context(network(hosts))
        path, store = directory / "lab.toml", directory / "certificates" if certificates else None
        path.write_text(fleet_text(net.addresses, agents, store))
        file = load_fleet(path)
        if certificates:
            make_certificates(file, datetime.now(UTC), days=1)
        for host in hosts:
            (directory / host).mkdir(mode=0o700)
            environment = os.environ | {"RCOPTERX_RUN": str(directory / host)}
            words = ("-m", "rcopterx", "up", str(path), "--host", host, "--no-record")
            stack.enter_context(net.running(host, words, environment, subprocess.DEVNULL))
        # This process uses the router of a host, which it finds by the run directory.
        stack.enter_context(environment_with({"RCOPTERX_RUN": str(directory / LABORATORY)}))
        fleet = stack.enter_context(closing(Fleet(file, LABORATORY, FIRST_ROUTER_S)))
        fleet.wait_ready(timeout_s=READY_S)
        fleet.wait_until(
            lambda: all(status.spare_ready for status in fleet.launchers().values()), READY_S, "no spares"
        )
        return _measured(fleet, seconds)


def _measured(fleet: Fleet, seconds: float) -> list[Commands]:
    names = list(fleet.file.vehicles)
    fleet.take_off()
    fleet.wait_for_formation()
    time.sleep(SETTLE_S)
    depth = int(200 * (seconds + SETTLE_S))
    inboxes = [fleet.session.subscribe(channels.APPLIED, name, depth=depth) for name in names]
    fly_legs(fleet, seconds)
    drained = [[received.message for received in inbox.drain()] for inbox in inboxes]
    fleet.land()
    return [
        [(applied.frame, times_s) for applied in messages if (times_s := _times_s(applied)) is not None]
        for messages in drained
    ]


def fleet_text(addresses: Mapping[str, str], agents: Mapping[str, str], certificates: Path | None) -> str:
    """Text of the fleet file `trio` over several hosts, by addresses, hosts of agents, and certificates."""
    fleet = tomlkit.parse(fleet_path("trio").read_text(encoding="utf-8"))
    fleet["tracker"] = {"address": f"{addresses[LABORATORY]}:{TRACKER_PORT}"}
    fleet["hosts"] = {
        host: {"address": address, "router_port": ROUTER_PORT} for host, address in addresses.items()
    }
    fleet["security"] = {"insecure": True} if certificates is None else {"certificates": str(certificates)}
    for name, vehicle in fleet["vehicles"].items():
        vehicle["host"] = agents[name]
    return tomlkit.dumps(fleet)
