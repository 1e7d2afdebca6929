"""A helicopter, a Crazyflie and a quadrotor with an autopilot in one formation, with real processes."""

import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise

import pytest
from integration_support import NAMES, Flying, Truth, fly_to, landed_gently, of_types
from pymavlink.dialects.v20 import common as mavlink
from radio_support import kill_gateway_in_flight, module
from support.udp import udp_paths

from rcopterx.simulator.faults import BreakRadio, Recover
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]
TYPES = {"h1": "coaxial", "h2": "crazyflie", "h3": "mavlink_quadrotor"}


LONGEST_GAP_S = 0.1  # between two poses for an autopilot


class PoseLink:
    """The further link of an autopilot; it counts what arrives there."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.port = self._socket.getsockname()[1]
        self._reader = mavlink.MAVLink(None)

    def arrivals_s(self) -> list[float]:
        """When the poses that have arrived since the last call were received by the Vicon gateway."""
        found: list[float] = []
        with suppress(BlockingIOError):
            while True:
                packets = self._reader.parse_buffer(self._socket.recv(2048)) or []
                found += [1e-6 * packet.usec for packet in packets]
        return found

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def pose_link() -> Iterator[PoseLink]:
    link = PoseLink()
    yield link
    link.close()


def test_three_families_fly_a_formation_and_an_autopilot_lands_by_itself_when_its_radio_is_gone(
    launch: Launch, pose_link: PoseLink
) -> None:
    paths = udp_paths(2)
    with_poses = f'"{paths[1]}", settings = {{ pose_port = "udp://127.0.0.1:{pose_link.port}" }}'
    text = of_types(TYPES, ("radio-h1", *paths)).replace(f'"{paths[1]}"', with_poses)
    flying = launch(text)
    fleet, truth = flying.fleet, Truth(flying)
    fleet.wait_until(lambda: "16.80 V, link 100 %" in module(flying, "h3"), 30, "no battery")
    fleet.take_off(NAMES, height_m=0.7, timeout_s=40)
    fleet.wait_for_formation()
    truth.start_watch()
    fly_to(flying, truth, (0.3, 0.2, 0.9))

    pose_link.arrivals_s()
    kill_gateway_in_flight(flying)
    fleet.wait(1.0)
    gaps_s = [after_s - before_s for before_s, after_s in pairwise(pose_link.arrivals_s())]
    assert len(gaps_s) > 40
    assert max(gaps_s) < LONGEST_GAP_S, "the Vicon gateway sends on"
    fly_to(flying, truth, (-0.2, 0.1, 0.8))
    truth.assert_none_touched_down()

    inject_faults(fleet.session, BreakRadio("h3", "unplugged"))
    fleet.wait_until(lambda: landed_gently(truth, "h3"), 30, "h3 has not landed")
    inject_faults(fleet.session, Recover())
    fleet.wait_until(lambda: module(flying, "h3").startswith("ready"), 30, "h3 is not ready again")
    fleet.land(["h1", "h2"])
    fleet.wait_until(lambda: all(landed_gently(truth, name) for name in ("h1", "h2")), 30, "not landed")
