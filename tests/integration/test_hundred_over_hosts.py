"""A hundred vehicles over ten hosts (network namespaces) with mutual TLS, in slow motion: half an hour."""

import runpy
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest
import tomlkit
from hosts_support import ROUTER_PORT, TRACKER_PORT, daemon
from scipy.spatial.distance import pdist
from support.namespaces import NetworkNamespaces, network_or_skip
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.daemons import Daemons
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.vehicles.state import Array

EXAMPLE = Path(__file__).parents[2] / "examples" / "hundred.py"
hundred = SimpleNamespace(**runpy.run_path(str(EXAMPLE)))

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(6000)]

SPEED = 0.02
CLOSEST_M = 0.3
STANDING_S = 4.0
RMS_MM, LARGEST_MM = 130.0, 250.0
"""Largest errors of vehicles that stand in formation."""
START_S = 120.0
LINKED_S = 300.0
"""Limits in real time, for the processes of ten hosts on one computer."""
LIMIT_S = 40.0
"""Limit of a take-off or landing, in the time of the fleet."""


def over_hosts(file: FleetFile, net: NetworkNamespaces, certificates: Path) -> str:
    """Text of the fleet file `hundred` with a host for each group."""
    text = tomlkit.parse(fleet_path("hundred").read_text(encoding="utf-8"))
    hosts = list(net.addresses)
    text["simulator"]["speed"] = SPEED
    text["tracker"] = {"address": f"{net.addresses[hosts[0]]}:{TRACKER_PORT}"}
    text["hosts"] = {
        host: {"address": address, "router_port": ROUTER_PORT} for host, address in net.addresses.items()
    }
    text["security"] = {"certificates": str(certificates)}
    host_of = dict(zip(hundred.groups_of(file), hosts, strict=True))
    for name, vehicle in file.vehicles.items():
        text["vehicles"][name]["host"] = host_of[name if name in host_of else vehicle.follow[0].leader]
    return tomlkit.dumps(text)


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    """A hundred standing vehicles, started through the daemons of ten hosts."""
    shipped = load_fleet(fleet_path("hundred"))
    hosts = ["main", *(f"control{number}" for number in range(1, len(hundred.groups_of(shipped))))]
    with ExitStack() as stack:
        net = stack.enter_context(network_or_skip(hosts))
        # A short path, because the routers' sockets live in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", str(Path(run) / hosts[0]))
        path = tmp_path / "hundred.toml"
        path.write_text(over_hosts(shipped, net, tmp_path / "certificates"))
        file = load_fleet(path)
        make_certificates(file, datetime.now(UTC), days=1)
        for number, host in enumerate(hosts, 1):
            stack.enter_context(daemon(net, path, host))
            if number == 1:
                joined = stack.enter_context(closing(Fleet(file, hosts[0], LINKED_S)))
            # One after the other: ten that import at once would exceed their limits.
            wait_for_hosts(joined, number)
        daemons = Daemons(joined)
        wait_for(lambda: not daemons.find(), "not all hosts are linked", LINKED_S)
        began_s = time.monotonic()
        assert len(daemons.start()) == len(hosts)
        joined.wait_ready(timeout_s=START_S * SPEED)
        print(f"ready after {time.monotonic() - began_s:.0f} s of real time", flush=True)
        yield joined
        assert daemons.stop() == []


def wait_for_hosts(fleet: Fleet, count: int) -> None:
    """Wait until the daemons of so many hosts are linked."""
    wait_for(lambda: len(fleet.launchers()) == count, f"daemon {count} is not linked", LINKED_S)


def missed(fleet: Fleet) -> int:
    """Control periods that the agents of a fleet have missed."""
    agents = [fleet.state_of(name).agent for name in fleet.file.vehicles]
    return sum(agent.diagnostics.missed_ticks for agent in agents if agent is not None)


def places_m(recorder: FlightSampler, names: Sequence[str]) -> Array:
    """True places of vehicles, shape (k, n, 3), while a recorder ran, which is stopped."""
    messages = recorder.stop().messages(channels.LABORATORY, channels.SIMULATOR_UNIT)
    return np.array([[state.vehicles[name].position_m for name in names] for state, _ in messages])


def closest_m(places: Array) -> float:
    """Smallest distance of two vehicles at any time."""
    return min(float(pdist(at_once).min()) for at_once in places)


def errors_mm(file: FleetFile, places: Array) -> tuple[float, float]:
    """Errors of all followers, rms and maximum, from their places beside their leaders."""
    names = list(file.vehicles)
    links = [(name, vehicle.follow[0]) for name, vehicle in file.vehicles.items() if vehicle.follow]
    beside = [places[:, names.index(name)] - places[:, names.index(link.leader)] for name, link in links]
    errors = np.array(beside) - np.array([link.offset_m for _, link in links])[:, None]
    distances = 1e3 * np.linalg.norm(errors, axis=-1)
    return float(np.sqrt(np.mean(distances**2, axis=1)).max()), float(distances.max())


def test_a_hundred_take_off_change_their_formation_and_land_over_ten_hosts(fleet: Fleet) -> None:
    """No period is missed, no two vehicles come close, and every vehicle lands."""
    names = list(fleet.file.vehicles)
    recorder = FlightSampler(fleet.session, only=(channels.LABORATORY,))
    fleet.take_off(height_m=hundred.HEIGHT_M, timeout_s=LIMIT_S)
    fleet.wait_for_formation()
    recorder.start()
    fleet.wait(STANDING_S)
    rms_mm, max_mm = errors_mm(fleet.file, places_m(recorder, names))
    print(f"worst vehicle {rms_mm:.0f} mm, largest error {max_mm:.0f} mm, {missed(fleet)} missed", flush=True)
    recorder.start()
    for part, size_m in ((hundred.crowns, hundred.CROWN_M), (hundred.wave, hundred.WAVE_M)):
        part(fleet, size_m)
        print(f"{part.__name__}: {missed(fleet)} periods missed", flush=True)
    nearest_m = closest_m(places_m(recorder, names))
    print(f"closest {1e3 * nearest_m:.0f} mm", flush=True)
    fleet.land(timeout_s=LIMIT_S)
    assert missed(fleet) == 0
    assert nearest_m > CLOSEST_M
    assert rms_mm < RMS_MM
    assert max_mm < LARGEST_MM
