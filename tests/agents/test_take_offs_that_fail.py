"""A pose that fails during the lift-off stops the motors at once: true heights of the simulated vehicles."""

import pytest
from support.take_offs import TakeOffs

from rcopterx.transmitter_gateway.inputs import State

TYPES = ["coaxial", "crazyflie", "betaflight", "mavlink_quadrotor"]
HIGHEST_M = 0.15
HARDEST_M_S = 1.0


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("freezes_s", [0.0, 0.3, 0.6, 0.8])
def test_a_pose_that_freezes_in_the_lift_off_stops_the_motors(kind: str, freezes_s: float) -> None:
    bench = TakeOffs({"h1": kind})
    bench.take_off("h1")
    bench.run(freezes_s)
    frozen = bench.views["h1"]()
    bench.views["h1"] = lambda: frozen
    bench.run(4.0)
    assert bench.highest_m["h1"] < HIGHEST_M
    assert bench.hardest_m_s["h1"] < HARDEST_M_S
    assert bench.plants["h1"].on_floor
    assert bench.arbiters["h1"].state is State.CUT
    assert bench.arbiters["h1"].reason == "lift-off: its pose repeats itself exactly: frozen"


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize(("rate_hz", "noise_m"), [(50, 0.0003), (100, 0.0015), (200, 0.0001)])
def test_an_ordinary_lift_off_is_not_stopped(kind: str, rate_hz: int, noise_m: float) -> None:
    bench = TakeOffs({"h1": kind}, rate_hz=rate_hz, position_noise_m=noise_m)
    bench.take_off("h1")
    assert bench.until_flying("h1", 4.0) < 4.0
    assert bench.arbiters["h1"].state is State.ARMED
