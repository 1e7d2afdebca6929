"""Promises of arbiter and firmware together: each state of the arbiter is one of the firmware."""

from collections.abc import Callable

import pytest
from firmware_bench import FirmwareBench

from rcopterx.radios.crazyflie import FALL_BACKS, CrazyflieProtocol, CrazyflieSettings
from rcopterx.simulator.crazyflie import BOOT_S, Crazyflie
from rcopterx.simulator.crazyflie_supervisor import (
    LEVEL_AFTER_S,
    PERIOD_S,
    SPIN_UP_S,
    STANDING_G,
    STOP_AFTER_S,
    TILTED_S,
    WATCHDOG_S,
)
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, LinkState, State
from rcopterx.transmitter_gateway.state_page import NOT_FLYING, PAGE_BYTES, StatePage

ON_ITS_SIDE_G = (0.0, 1.0)


class Bench(FirmwareBench):
    def __init__(self, *, arms_itself: bool, watchdog: bool = True) -> None:
        settings = CrazyflieSettings(watchdog=watchdog)
        self.settings = settings
        self.vehicle = Crazyflie(settings, arms_itself=arms_itself)
        super().__init__(self.vehicle, CrazyflieProtocol(settings))

    def restart_gateway(self, page: StatePage | None) -> None:
        """Replace the gateway by another process, a moment later."""
        self.now_s += 0.15
        self.connect(CrazyflieProtocol(self.settings))
        if page is not None:
            self.transmitter.resume(page, self.now_s)
            self.run(0.14, None)
        self.lease = self.transmitter.bid(2, self.now_s, take_over=False)

    @property
    def motors_run(self) -> bool:
        return self.vehicle.motors_run

    def fly(self) -> None:
        assert not any(self.run(1.5, 0.0))
        answer = self.transmitter.request(ActionRequest(Action.ARM, "operator"), self.now_s)
        assert answer.accepted, answer.reason
        self.run(0.8, 0.0)
        self.run(2.0)
        assert self.state is State.ARMED
        assert self.vehicle.motors_run
        assert self.vehicle.state.armed


@pytest.fixture(params=[True, False], ids=["brushed", "brushless"])
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(arms_itself=request.param)


def test_a_vehicle_that_is_not_armed_gets_no_thrust_and_is_disarmed(bench: Bench) -> None:
    assert not any(bench.run(3.0, 0.6))
    assert bench.state is State.DISARMED
    assert bench.vehicle.state.armed is bench.vehicle.state.arms_itself


def test_a_vehicle_is_armed_with_thrust_0_and_then_flies(bench: Bench) -> None:
    bench.fly()
    thrusts = [pulses[0] for _, pulses in bench.vehicle.take_outputs()]
    assert max(thrusts) == pytest.approx(1580.0, abs=1.0)


def test_a_kill_stops_the_motors_within_a_period_and_for_good(bench: Bench) -> None:
    bench.fly()
    assert bench.request(Action.KILL)
    bench.transmitter.tick(bench.now_s + 0.004)
    assert not bench.vehicle.motors_run
    bench.run(2 * PERIOD_S + 0.02, 0.0)
    assert bench.vehicle.state.locked
    bench.run(3.0, 0.0)
    assert bench.vehicle.state.locked
    assert not bench.request(Action.ARM), "killed until a reset"
    assert bench.request(Action.RESET)
    assert not bench.request(Action.ARM), "the firmware has not restarted yet"
    assert "locked after a stop" in bench.module
    bench.run(BOOT_S + 0.5, 0.0)
    bench.fly()


def test_an_overloaded_radio_refuses_arming_with_the_reason_and_ends_no_flight(bench: Bench) -> None:
    bench.air.full = "too many vehicles"
    bench.run(1.5, 0.0)
    reason = bench.transmitter.request(ActionRequest(Action.ARM, "operator"), bench.now_s).reason
    assert "transmitter ready: too many vehicles" in reason
    assert bench.module == "too many vehicles"
    bench.air.full = None
    bench.fly()
    bench.air.full = "too many vehicles"
    bench.run(2.0)
    assert bench.state is State.ARMED
    assert bench.vehicle.motors_run


def test_without_commands_the_arbiter_holds_and_lands_before_the_firmware_acts(bench: Bench) -> None:
    bench.fly()
    bench.vehicle.take_outputs()
    assert all(bench.run(LEVEL_AFTER_S + 1.0, None))
    assert bench.state is State.LAND
    assert not bench.vehicle.state.locked


@pytest.mark.parametrize("watchdog", [True, False])
def test_a_gateway_that_dies_leaves_a_vehicle_that_levels_and_stops_itself(watchdog: bool) -> None:
    bench = Bench(arms_itself=True, watchdog=watchdog)
    bench.fly()
    bench.vehicle.take_outputs()
    died_s = bench.now_s
    bench.vehicle.advance(died_s + 10.0)
    (level_s, level), (stop_s, stopped) = bench.vehicle.take_outputs()
    assert level_s - died_s == pytest.approx(LEVEL_AFTER_S, abs=0.03 + PERIOD_S)
    assert level[1:4] == pytest.approx((1500.0, 1500.0, 1500.0))
    assert stopped[0] == 1100.0
    if watchdog:
        assert WATCHDOG_S - 0.3 <= stop_s - died_s <= WATCHDOG_S + PERIOD_S
    else:
        assert stop_s - died_s == pytest.approx(STOP_AFTER_S, abs=0.03 + PERIOD_S)
    assert bench.vehicle.state.locked


def test_a_vehicle_that_restarts_in_flight_is_not_flown_on(bench: Bench) -> None:
    bench.fly()
    bench.vehicle.power_cycle(bench.now_s)
    assert not any(bench.run(1.0)), "its thrust waits for a set point without thrust"


def armed(bench: Bench) -> None:
    bench.run(1.5, 0.0)
    assert bench.request(Action.ARM)


def test_an_arming_counts_once_the_firmware_can_fly() -> None:
    bench = Bench(arms_itself=False)
    armed(bench)
    bench.run(SPIN_UP_S - 0.1, 0.0)
    assert bench.vehicle.state.armed
    assert bench.transmitter.link(bench.now_s).armed is False
    bench.run(0.5, 0.0)
    assert bench.transmitter.link(bench.now_s).armed is True


def test_thrust_for_motors_that_have_not_spun_up_ends_the_take_off() -> None:
    bench = Bench(arms_itself=False)
    bench.vehicle.supervisor.blocked = True
    armed(bench)
    assert not any(bench.run(1.0))
    assert bench.state is not State.ARMED
    assert "its motors have not spun up" in bench.transmitter.arbiter.reason


def test_arming_that_the_firmware_refuses_is_requested_twice_and_the_reason_is_its_own_words() -> None:
    bench = Bench(arms_itself=False)
    bench.vehicle.supervisor.blocked = True
    bench.height_m = 0.02
    armed(bench)
    bench.run(10.0, 0.0)
    assert bench.state is State.DISARMED
    assert "did not arm: SUP: M3 arming RPM check" in bench.transmitter.arbiter.reason
    assert bench.vehicle.supervisor.spin_ups == FALL_BACKS
    assert bench.transmitter.link(bench.now_s).armed is False
    bench.vehicle.supervisor.blocked = False
    bench.request(Action.DISARM)
    bench.fly()


def lies(vehicle: Crazyflie) -> None:
    vehicle.supervisor.force_g = ON_ITS_SIDE_G


def crashes(vehicle: Crazyflie) -> None:
    vehicle.supervisor.crashed = True


def locks(vehicle: Crazyflie) -> None:
    vehicle.supervisor.stops = True


@pytest.mark.parametrize(
    ("happens", "reason"),
    [
        (lies, "the vehicle lies on its side: put it upright"),
        (crashes, "the vehicle has crashed: check it and reset it"),
        (locks, "the vehicle is locked after a stop: reset it, or switch it off and on"),
        (Crazyflie.switch_off, "vehicle gone: silent for"),
    ],
)
def test_a_vehicle_that_would_not_fly_is_not_ready_a_second_after_its_firmware_notices_it(
    bench: Bench, happens: Callable[[Crazyflie], None], reason: str
) -> None:
    bench.run(1.5, 0.0)
    assert bench.module.startswith("ready")
    happens(bench.vehicle)
    noticed_s = TILTED_S if happens is lies else 0.0 if bench.vehicle.powered else 0.3
    bench.run(noticed_s + 1.0, 0.0)
    assert not bench.request(Action.ARM)
    assert bench.module.startswith(reason)


def test_a_vehicle_that_arms_itself_anew_while_it_stands_stays_ready() -> None:
    bench = Bench(arms_itself=True)
    bench.run(1.0, 0.0)
    for _ in range(340):
        bench.run(0.1, 0.0)
        assert bench.transmitter.link(bench.now_s).state is LinkState.READY, bench.module


def stand_after_a_flight(bench: Bench) -> None:
    bench.fly()
    bench.height_m = 0.02
    bench.run(5.0, None)
    assert bench.state is State.CUT
    assert not bench.vehicle.state.locked


def test_a_successor_of_a_gateway_that_died_on_the_floor_feeds_the_watchdog_on(bench: Bench) -> None:
    page = StatePage(bytearray(PAGE_BYTES), b"boot")
    page.save(NOT_FLYING)
    bench.transmitter.resume(page, 0.0)
    bench.run(1.0, 0.0)
    stand_after_a_flight(bench)
    bench.restart_gateway(page)
    bench.run(3 * WATCHDOG_S, 0.0)
    assert not bench.vehicle.state.locked
    bench.fly()


def test_the_end_of_a_gateway_leaves_vehicles_that_fly_without_a_power_cycle(bench: Bench) -> None:
    stand_after_a_flight(bench)
    bench.request(Action.SHUTDOWN)
    while not bench.transmitter.finished:
        bench.run(0.02, None)
    bench.now_s += 10.0
    bench.live()
    assert not bench.vehicle.state.locked
    bench.restart_gateway(None)
    bench.fly()


@pytest.mark.parametrize("tumbled", [True, False])
def test_a_crashed_vehicle_flies_after_a_reset_once_it_is_upright(bench: Bench, tumbled: bool) -> None:
    bench.fly()
    bench.vehicle.supervisor.force_g = ON_ITS_SIDE_G
    bench.run(TILTED_S + 2 * PERIOD_S)
    assert not bench.vehicle.motors_run
    if not tumbled:
        bench.vehicle.supervisor.force_g = STANDING_G
    bench.height_m = 0.02
    bench.run(5.0, None)
    assert bench.state is State.CUT
    assert not bench.request(Action.ARM)
    assert ("put it upright" if tumbled else "reset it") in bench.module
    if tumbled:
        assert not bench.request(Action.RESET)
        bench.vehicle.supervisor.force_g = STANDING_G
        bench.run(0.5, 0.0)
    assert bench.request(Action.RESET)
    bench.run(0.5, 0.0)
    bench.fly()


def test_a_killed_vehicle_stays_locked_when_its_gateway_ends(bench: Bench) -> None:
    bench.fly()
    bench.request(Action.KILL)
    bench.request(Action.SHUTDOWN)
    while not bench.transmitter.finished:
        bench.run(0.02, None)
    assert bench.vehicle.state.locked
