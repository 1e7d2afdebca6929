"""Parameters of an autopilot that flights depend on, read at the start (manuals of ArduPilot and PX4)."""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from rcopterx.radios.mavlink_settings import ARDUPILOT, PX4, MavlinkSettings

TRIES: Final = 3  # so many requests without an answer, and the firmware does not have the parameter


class Rule(NamedTuple):
    """A parameter under its present name, what has to hold, and the right value for people, with settings."""

    name: str
    holds: Callable[[float, MavlinkSettings], bool]
    right: str


THRUST_BIT: Final = 8


def _short(loss_s: float, _: MavlinkSettings) -> bool:
    """Whether a failsafe is neither reached while a gateway restarts, nor so late that the vehicle is far."""
    return 0.3 <= loss_s <= 1.0


RULES: Final[dict[int, tuple[Rule, ...]]] = {
    ARDUPILOT: (
        Rule("GUID_OPTIONS", lambda value, _: bool(int(value) & THRUST_BIT), "8, thrust of set points"),
        Rule("GUID_TIMEOUT", _short, "0.5 s"),
        Rule("FS_GCS_ENABLE", lambda value, _: value > 0, "5, land without the gateway"),
        Rule("MAV_GCS_SYSID", lambda value, own: value == own.own_system, "{0.own_system}, own_system"),
        Rule("SYSID_MYGCS", lambda value, own: value == own.own_system, "{0.own_system}, own_system"),
        Rule("ATC_ANGLE_MAX", lambda value, own: value >= own.full_tilt_deg, "{0.full_tilt_deg:g}"),
        Rule("ANGLE_MAX", lambda value, own: value >= 100 * own.full_tilt_deg, "100 * {0.full_tilt_deg:g}"),
    ),
    PX4: (
        Rule("COM_OF_LOSS_T", _short, "0.5 s"),
        Rule(
            "MC_YAWRATE_MAX", lambda value, own: value >= own.full_yaw_rate_deg_s, "{0.full_yaw_rate_deg_s:g}"
        ),
    ),
}


class ParameterCheck:
    """Reads the parameters."""

    def __init__(self, autopilot: int, settings: MavlinkSettings) -> None:
        self._settings = settings
        self._left = {rule.name: rule for rule in RULES[autopilot]}
        self._tries = 0
        self._wrong: list[str] = []

    def skip(self) -> None:
        """Read none: the vehicle flies."""
        self._left.clear()

    def wanted(self) -> list[str]:
        """Return the names that are to be requested now."""
        if self._tries == TRIES:
            self.skip()
        self._tries += 1
        return list(self._left)

    def take(self, message: Any) -> None:
        """Judge the answer to a request."""
        name, value = message.param_id, message.param_value
        rule = self._left.pop(name, None) if math.isfinite(value) else None
        if rule is not None and not rule.holds(value, self._settings):
            self._wrong.append(f"{name} is {value:g}, right is {rule.right.format(self._settings)}")

    @property
    def problem(self) -> str | None:
        """Which parameters forbid a flight, or that not all are read; None if all are right."""
        if self._wrong:
            return f"parameters of the autopilot: {'; '.join(self._wrong)}"
        return "the parameters of the autopilot are being read" if self._left else None
