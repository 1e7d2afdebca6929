"""All vehicles stop at one frame on what they fly, wait, and go on; also after the death of a process."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from integration_support import Flying, Truth

from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus
from rcopterx.control.references.path_shapes import circle, figure_eight
from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(240)]

AT_REST_M_S = 0.15
FORMATION_M = 0.15


def speeds(flying: Flying) -> dict[str, float]:
    truth = Truth(flying)
    flying.fleet.wait_until(lambda: truth("h1") is not None, 5, "no truth")
    return {
        name: float(np.linalg.norm(vehicle.velocity_m_s))
        for name in ("h1", "h2", "h3")
        if (vehicle := truth(name)) is not None
    }


def status_of(flying: Flying, name: str) -> AgentStatus:
    status = flying.fleet.state_of(name).agent
    assert status is not None, f"{name} reports nothing"
    return status


def has_ended(flying: Flying, name: str) -> bool:
    return status_of(flying, name).path_left_s == 0.0


def test_two_trajectories_and_a_follower_stop_and_go_on(fly: Callable[..., None]) -> None:
    fly(stop_and_go_on)


def stop_and_go_on(flying: Flying) -> None:
    fleet = flying.fleet
    with pytest.raises(RefusedError, match="no vehicle that leads is in the air"):
        fleet.suspend()
    fleet.take_off(height_m=0.8, timeout_s=40)
    fleet.wait_for_formation()
    fleet["h3"].lead()
    fleet["h1"].fly(circle((0.2, 0.3, 0.9), 0.3, 6.0, turns=3.0))
    fleet["h3"].fly(figure_eight((-0.4, -0.8, 0.9), (0.3, 0.2), 6.0, 3.0))
    fleet.wait(8.0)
    frames = fleet.session.subscribe(channels.PLAN, "h1", depth=1000)
    assert fleet.suspend() == ["h1: suspended", "h3: suspended"]
    fleet.wait(3.0)
    assert max(speeds(flying).values()) < AT_REST_M_S
    left_s = status_of(flying, "h1").path_left_s
    stopped_m = [received.message.trajectory.to_numpy()[0, :3] for received in frames.drain()][-1]
    flying.kill("agent-h1")
    fleet.wait_until(lambda: "suspended" in fleet["h1"].state.remarks, 15, "no successor remembers")
    fleet.wait(2.0)
    assert status_of(flying, "h1").path_left_s == pytest.approx(left_s, abs=0.1)
    plans = [received.message.trajectory.to_numpy() for received in frames.drain()]
    assert plans[-1][:, :3] == pytest.approx(np.tile(stopped_m, (len(plans[-1]), 1)), abs=0.1)
    assert fleet.resume() == ["h1: goes on", "h3: goes on"]
    fleet.wait(3.0)
    assert min(speeds(flying)[name] for name in ("h1", "h3")) > AT_REST_M_S
    assert fleet["h2"].state.error_m < FORMATION_M
    for name, end_m in (("h1", (0.5, 0.3, 0.9)), ("h3", (-0.4, -0.8, 0.9))):
        fleet.wait_until(partial(has_ended, flying, name), 30, "it does not end", [name])
        assert status_of(flying, name).set_point.position_m == pytest.approx(end_m, abs=1e-6)
    with pytest.raises(RefusedError, match="h1: nothing is suspended; h3: nothing is suspended"):
        fleet.resume()
