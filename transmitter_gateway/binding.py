"""Binding of a receiver: bind frames until the module is done, then a time of neutral frames."""

import math

from rcopterx.radios.protocol import ModuleStatus

LONGEST_BIND_S = 7.0
POWER_UP_LIMIT_S = 30.0  # how long a board that binds only when it is switched on is waited for
AFTER_BIND_S = 5.0


class Binding:
    """Progress of a bind; `active` while frames request it, `at_power_up` only when switched on."""

    def __init__(self, *, at_power_up: bool) -> None:
        self.active = False
        self._at_power_up = at_power_up
        self._limit_s = -math.inf
        self._seen = False
        self._settled_s = -math.inf

    def begin(self, now_s: float) -> None:
        """Begin to bind."""
        self.active, self._seen = True, False
        self._limit_s = now_s + (POWER_UP_LIMIT_S if self._at_power_up else LONGEST_BIND_S)

    def link_opened(self, now_s: float) -> None:
        """Go on with a board that was switched on; a module of which the port was lost binds no more."""
        self.active = self.active and self._at_power_up
        self._limit_s = min(self._limit_s, now_s + LONGEST_BIND_S)

    def follow(self, module: ModuleStatus, now_s: float) -> None:
        """End when the module has bound, or after the limit."""
        if not self.active:
            return
        over = self._seen and not module.binding
        self._seen = self._seen or module.binding
        if over or now_s >= self._limit_s:
            self.active = False
            self._settled_s = now_s + AFTER_BIND_S

    def busy(self, now_s: float) -> bool:
        """Whether a bind is under way, or its receiver still has to store the neutral frames."""
        return self.active or now_s < self._settled_s
