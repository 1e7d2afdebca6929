"""Promises of the arbiter to a vehicle that is not as calibrated, whatever happens to commands and poses."""

from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)
from landing_plant import Flight, Tracker, Vehicle

vehicles = st.builds(
    Vehicle,
    hover=st.floats(0.2, 0.9),
    slope=st.floats(0.7, 1.4),
    cyclic_gain=st.floats(0.5, 1.5),
    rotor_lag_s=st.floats(0.04, 0.15),
    tilt_rad_s=st.floats(10.0, 25.0),
    tilt_damping=st.floats(0.3, 1.0),
    delay_s=st.sampled_from([0.02, 0.04, 0.06, 0.08]),
    bounce=st.floats(0.0, 0.6),
    kick_m_s=st.sampled_from([0.0, 0.5, 1.0]),
    ground_effect=st.floats(0.0, 0.1),
    discharge_per_s=st.sampled_from([0.0, 0.0, 0.005, 0.015]),
)
trackers = st.builds(
    Tracker,
    steps=st.sampled_from([1, 2, 4]),
    noise_m=st.sampled_from([0.0, 0.0003, 0.001, 0.002]),
    lost=st.sampled_from([0.0, 0.0, 0.1, 0.3]),
)
in_the_air = precondition(lambda self: not self.flight.over and self.flight.in_the_air)


class LandingMachine(RuleBasedStateMachine):
    """`Flight` checks after every step that no vehicle that is seen in the air is off."""

    def __init__(self) -> None:
        super().__init__()
        self.flight = Flight(Vehicle(), Tracker())

    @initialize(
        vehicle=vehicles, tracker=trackers, seed=st.integers(0, 99), height_m=st.floats(0.3, 1.6),
        hover_s=st.floats(0.0, 3.0),
    )  # fmt: skip
    def take_off(
        self, vehicle: Vehicle, tracker: Tracker, seed: int, height_m: float, hover_s: float
    ) -> None:
        self.flight = Flight(vehicle, tracker, seed)
        self.flight.take_off(height_m)
        self.flight.fly(hover_s)

    @in_the_air
    @rule(height_m=st.floats(0.3, 1.8), climb_m_s=st.floats(0.1, 0.8), seconds=st.floats(0.2, 2.0))
    def fly(self, height_m: float, climb_m_s: float, seconds: float) -> None:
        self.flight.height_m, self.flight.climb_m_s = height_m, climb_m_s
        self.flight.fly(seconds)

    @in_the_air
    @rule(x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5))
    def go(self, x: float, y: float) -> None:
        self.flight.place = (x, y)
        self.flight.fly(0.5)

    @in_the_air
    @rule(seconds=st.floats(0.02, 4.0), seen=st.booleans())
    def lose_commands(self, seconds: float, seen: bool) -> None:
        self.flight.commanding, self.flight.seeing = False, seen
        self.flight.fly(seconds)
        self.flight.commanding = self.flight.seeing = True

    @in_the_air
    @rule(seconds=st.floats(0.02, 1.0))
    def lose_poses(self, seconds: float) -> None:
        self.flight.seeing = False
        self.flight.fly(seconds)
        self.flight.seeing = True

    @in_the_air
    @rule(
        x=st.floats(-0.5, 0.5), z=st.floats(-0.5, 0.5), seconds=st.floats(0.02, 0.5), commanding=st.booleans()
    )
    def see_it_elsewhere(self, x: float, z: float, seconds: float, commanding: bool) -> None:
        self.flight.shift_m, self.flight.commanding = (x, 0.0, z), commanding
        self.flight.fly(seconds)
        self.flight.shift_m, self.flight.commanding = (0.0, 0.0, 0.0), True

    @in_the_air
    @rule(silence_s=st.floats(0.04, 0.3))
    def restart_the_gateway(self, silence_s: float) -> None:
        self.flight.restart_gateway(silence_s)

    @in_the_air
    @rule()
    def kill(self) -> None:
        self.flight.kill()

    @rule()
    def wait(self) -> None:
        """There is a step for a vehicle that is down, too."""

    def teardown(self) -> None:
        """Without commands the vehicle lands by itself."""
        self.flight.commanding = False
        self.flight.until_down()


def test_any_vehicle_lands_gently_and_is_never_off_while_seen_in_the_air() -> None:
    drawn = [Phase.explicit, Phase.reuse, Phase.generate]  # Shrinking flights takes minutes.
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        LandingMachine, settings=settings(max_examples=25, stateful_step_count=8, phases=drawn)
    )
