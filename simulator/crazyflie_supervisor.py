"""Supervisor of a Crazyflie: what it decides 25 times a second whether its motors may run.

States, transitions, order and numbers: crazyflie-firmware 2026.08 (2a18fc2), `supervisor_state_machine.c`,
`supervisor.c`, `platform_defaults.h`, `Kconfig` with `cf2_defconfig` and `cf21bl_defconfig`.
"""

import math
from typing import Final

from rcopterx.radios.crtp import SupervisorState
from rcopterx.tables import table_beside

PERIOD_S: Final = 0.04  # `RATE_SUPERVISOR`; at most one transition in each
LEVEL_AFTER_S: Final = 0.5  # `COMMANDER_WDT_TIMEOUT_STABILIZE`
STOP_AFTER_S: Final = 2.0  # `COMMANDER_WDT_TIMEOUT_SHUTDOWN`
WATCHDOG_S: Final = 1.0  # `DEFAULT_EMERGENCY_STOP_WATCHDOG_TIMEOUT`
FLYING_S: Final = 2.0  # `IS_FLYING_HYSTERESIS_THRESHOLD`: after the last thrust it still counts as flying
LANDED_S: Final = 3.0  # `LANDING_TIMEOUT_MS`, after which it checks itself and arms anew
STANDING_S: Final = 30.0  # `PREFLIGHT_TIMEOUT_MS`: so long it stays armed without thrust
SPIN_UP_S: Final = 0.3  # measured 0.24 s; `MOTORS_ARMING_RPM_DURATION_MS` is 0.2 s of it
SPIN_UP_LIMIT_S: Final = 2.0  # `ARMING_SPINUP_TIMEOUT_MS`
BLOCKED_S: Final = 0.2  # of a motor that turns below `MOTORS_RPM_NOT_RESPONDING_THRESHOLD`
FREE_FALL_G: Final = 0.1  # less in every direction is no tumble
TILTED_G, TILTED_S = 0.5, 1.0  # `SUPERVISOR_TUMBLE_CHECK_ACCEPTED_TILT_ACCZ` and `_TIME`
INVERTED_G, INVERTED_S = -0.2, 0.1  # `SUPERVISOR_TUMBLE_CHECK_ACCEPTED_UPSIDEDOWN_ACCZ` and `_TIME`
TRANSITIONS: Final = table_beside(__file__, "crazyflie_states")
STANDING_G: Final = 1.0, 0.0
FLIES: Final = ("ready", "flying", "level", "landed")


class FirmwareSupervisor:
    """The state machine; its inputs are attributes.

    `arms_itself`: as brushed vehicles do. `armed`, `crashed`: as requested, or as the newest state left them.
    `stops`: whether an emergency stop was requested. `fed_s`: when the watchdog was fed, infinite before the
    first time. `blocked`: whether a motor cannot turn. `force_g`: specific force along the upper axis of the
    body, and across. `spin_ups`: how often motors were armed. `state`, `report`: as they were last computed.
    """

    def __init__(self, now_s: float, *, arms_itself: bool) -> None:
        self.arms_itself = arms_itself
        self.state, self.report = "checks fail", SupervisorState(arms_itself=arms_itself)
        self.armed = self.crashed = self.stops = self.blocked = False
        self.force_g = STANDING_G
        self.spin_ups = 0
        self._entered_s, self._thrust_s = now_s, -math.inf
        self.fed_s = self._tilted_s = self._blocked_s = math.inf

    def request_arming(self, *, on: bool) -> bool:
        """Arm, or disarm; return whether it obeys."""
        self.armed = on and (self.armed or self.state == "checks pass")
        return self.armed is on

    def step(self, now_s: float, set_point_s: float, *, thrusts: bool) -> None:
        """Decide once more; `set_point_s`: arrival of the newest. `thrusts`: motors run faster than idle."""
        self._thrust_s = now_s if thrusts else self._thrust_s
        stuck = self.blocked and self.state in FLIES
        self._blocked_s = min(self._blocked_s, now_s) if stuck else math.inf
        age_s, lasted_s = now_s - set_point_s, now_s - self._entered_s
        thrust, tumbled = now_s - self._thrust_s < FLYING_S, self._tumbled(now_s)
        conditions = {
            "always": True,
            "armed": self.armed,
            "thrust": thrust,
            "tumbled": tumbled,
            "recovered": not tumbled and not self.crashed,
            "late": age_s > LEVEL_AFTER_S,
            "gone": age_s > STOP_AFTER_S,
            "stop": self.stops or now_s >= self.fed_s + WATCHDOG_S,
            "stood": lasted_s > STANDING_S,
            "rested": lasted_s > LANDED_S,
            "spun": self.arms_itself or (not self.blocked and lasted_s >= SPIN_UP_S),
            "slow": lasted_s > SPIN_UP_LIMIT_S,
            "blocked": now_s - self._blocked_s >= BLOCKED_S,
        }
        for state, causes in TRANSITIONS[self.state].items():
            if any(conditions[one.removeprefix("not-")] != one.startswith("not-") for one in causes.split()):
                self._enter(state, now_s)
                break
        now = self.state
        self.report = SupervisorState(
            now == "checks pass", self.armed, self.arms_itself, now in FLIES, now in ("flying", "level"),
            tumbled, now == "locked", self.crashed,
        )  # fmt: skip

    def _enter(self, state: str, now_s: float) -> None:
        self.state, self._entered_s = state, now_s
        self.spin_ups += state == "arming"
        self.crashed = self.crashed or state == "crashed"
        keeps = state == "arming" or state in FLIES
        self.armed = self.armed if keeps else self.arms_itself and state == "checks pass"

    def _tumbled(self, now_s: float) -> bool:
        """Whether it lies or flies on its side, or upside down, for too long."""
        up_g, across_g = self.force_g
        if up_g >= TILTED_G or max(abs(up_g), across_g) < FREE_FALL_G:
            self._tilted_s = math.inf
        self._tilted_s = min(self._tilted_s, now_s if up_g < TILTED_G else math.inf)
        lasted_s = now_s - self._tilted_s
        return lasted_s > TILTED_S or (up_g < INVERTED_G and lasted_s > INVERTED_S)
