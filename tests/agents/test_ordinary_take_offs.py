"""Ordinary take-offs: no false alarm, and hardly later than by a thrust that rises without a question.

Vehicles of the four types are drawn from their families, with noise of 0.1 to 1.5 mm at 50 to 200 Hz and
batteries at 75 to 100 %. For 0.2 s there are no poses; some stand on a soft mat, some take off in pairs.
Vehicles that weigh over `HEAVY` times as much as their model may stay on the floor, with the reason, because
no thrust that lifts them is safe for a vehicle that is not seen.
"""

import random
import statistics
from dataclasses import dataclass, field

import pytest
from support.take_offs import TakeOffs

from rcopterx.simulator.plant import BodyPose, PlantFaults
from rcopterx.transmitter_gateway.inputs import State
from rcopterx.vehicles.lift_off import NOT_RISEN
from rcopterx.vehicles.phases import Phase

RISEN_M = 0.3
GIVEN_S = 10.0
GAP_S = 0.2
MAT_M_S = 0.3  # speed at which a soft mat gives way
EMPTY_SHARE = 0.7  # of its thrust that an empty battery has left: the largest sag of the battery in flights
LATER_S = 1.0
BEFORE_S = {"coaxial": 2.27, "crazyflie": 2.55, "betaflight": 2.42, "mavlink_quadrotor": 2.28}
"""Mean time to `RISEN_M` by an open-loop ramp of the thrust, over the first 60 of these take-offs."""
HOP_M = 0.02
HEAVY = 1.2
ALARMS = ("entered LAND", "entered DESCEND", "entered CUT", "entered DISARMED")


@dataclass
class Ordinary:
    """One take-off, drawn by its number."""

    number: int
    bench: TakeOffs = field(init=False)
    risen_s: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.random = random.Random(self.number)
        types = list(BEFORE_S)
        kinds = [types[self.number % len(types)]]
        if self.random.random() < 0.4:
            kinds.append(self.random.choice(types))
        self.kinds = {f"h{place}": kind for place, kind in enumerate(kinds, 1)}
        rate_hz = self.random.choice([50, 100, 200])
        noise_m = self.random.uniform(1e-4, 1.5e-3)
        # Crazyflies drawn around the identified ones have their own sticks, unlike quadrotors.
        conditions = "crazyflies" if set(kinds) <= {"coaxial", "crazyflie"} else "helicopters"
        self.bench = TakeOffs(
            self.kinds, conditions, seed=self.number, rate_hz=rate_hz, position_noise_m=noise_m
        )
        self.gap_s = self.random.uniform(0.0, 2.5)
        self.mat_m = self.random.uniform(0.0, 0.015) if self.random.random() < 0.4 else 0.0
        for plant in self.bench.plants.values():
            charge = self.random.uniform(0.75, 1.0)
            plant.faults = PlantFaults(thrust_factor=1.0 - (1.0 - EMPTY_SHARE) * (1.0 - charge))

    def fly(self) -> None:
        bench = self.bench
        bench.take_off()
        self.began_s = bench.now_s
        for name in self.kinds:
            bench.views[name] = self.view(name)
        while bench.now_s < self.began_s + GIVEN_S:
            bench.run(bench.frame_s)
            for name, plant in bench.plants.items():
                if plant.position_m[2] > RISEN_M:
                    self.risen_s.setdefault(name, bench.now_s - self.began_s)
            over_s = max(self.gap_s + GAP_S, *self.risen_s.values(), 0.0) + 0.4
            if self.risen_s.keys() == self.kinds.keys() and bench.now_s > self.began_s + over_s:
                return

    def view(self, name: str):  # type: ignore[no-untyped-def]
        """Poses of a vehicle that sinks into its mat as far as its rotor does not carry it."""
        seen, plant = self.bench.views[name], self.bench.plants[name]
        hover = self.bench.pilots[name].model.hover_thrust
        sunk_m = self.mat_m

        def pose() -> BodyPose | None:
            nonlocal sunk_m
            found = seen()
            thrust = float(self.bench.pilots[name].input_history.newest[2])
            carried_m = self.mat_m * max(0.0, 1.0 - thrust / hover) if plant.on_floor else 0.0
            step_m = MAT_M_S * self.bench.frame_s
            sunk_m += min(max(carried_m - sunk_m, -step_m), step_m)
            if found is None or self.gap_s <= self.bench.now_s - self.began_s < self.gap_s + GAP_S:
                return None
            if not plant.on_floor:
                return found
            x, y, z = found.position_m
            return BodyPose((x, y, z - sunk_m), found.yaw_rad, found.pitch_rad, found.roll_rad)

        return pose


@pytest.mark.parametrize(
    "numbers",
    [
        range(12),
        *(pytest.param(range(first, first + 30), marks=pytest.mark.campaign) for first in range(0, 300, 30)),
    ],
)
def test_ordinary_take_offs_raise_no_false_alarm_and_take_hardly_longer(numbers: range) -> None:
    later_s = []
    for number in numbers:
        flight = Ordinary(number)
        flight.fly()
        for name, kind in flight.kinds.items():
            arbiter, phase = flight.bench.arbiters[name], flight.bench.pilots[name].guidance.phase
            what = f"take-off {number}, {name} ({kind}): {phase}, {arbiter.state}: {arbiter.reason}"
            if NOT_RISEN in arbiter.reason:
                assert flight.bench.highest_m[name] < HOP_M, what
                assert Ordinary(number).bench.lifting_share(name) > HEAVY, what
                continue
            assert not any(arbiter.counters[alarm] for alarm in ALARMS), what
            assert phase in (Phase.TAKEOFF, Phase.FLYING), what
            assert arbiter.state is State.ARMED, what
            assert name in flight.risen_s, what
            later_s.append(flight.risen_s[name] - BEFORE_S[kind])
    assert statistics.mean(later_s) <= LATER_S


@pytest.mark.parametrize("number", [69, 96])
def test_a_heavy_vehicle_or_one_on_a_mat_that_touches_the_floor_again_takes_off(number: int) -> None:
    flight = Ordinary(number)
    flight.fly()
    for name in flight.kinds:
        assert flight.bench.arbiters[name].state is State.ARMED
        assert name in flight.risen_s
