"""The control lease of an agent: requested at start, sent with every command, lost to a later agent."""

import math
from typing import Final

BID_PERIOD_S: Final = 0.01  # time between two bids; a lost one must not cost a control period
EAGER_S: Final = 1.0
LATER_BID_PERIOD_S: Final = 0.1  # time between two bids of an agent that has bid for longer than `EAGER_S`
WARM_S: Final = 2.0  # for which an agent watches the vehicle before it takes it over
REFUSED_S: Final = 0.5  # an agent that is refused for so long ends: another one flies its vehicle
IGNORED_S: Final = 0.3  # commands without effect for so long are of a lease that the gateway forgot


class ControlLease:
    """Permission to command a vehicle, granted by its transmitter gateway; times are monotonic [s]."""

    def __init__(self, agent: int, take_over: bool, now_s: float) -> None:
        self.agent = agent
        self.take_over = take_over
        self.number = 0  # the lease; 0 before there is one
        self.lost = False  # whether another agent commands, so that this one has to end
        self._began_s = now_s
        self._bid_at_s = now_s
        self._refused_since_s: float | None = None
        self._ignored_since_s: float | None = None

    @property
    def held(self) -> bool:
        """Whether the agent may command."""
        return self.number > 0 and not self.lost

    @property
    def quiet(self) -> bool:
        """Whether another agent publishes the status of the vehicle, as far as is known."""
        return not self.held and (self.lost or self.take_over or self._refused_since_s is not None)

    def on_answer(self, agent: int, number: int, commanding: int, now_s: float) -> None:
        """Process an answer to a bid of any agent: its lease, 0 for none, and the lease in force."""
        if agent == self.agent:
            if number:
                self.number, self._refused_since_s, self._ignored_since_s = number, None, None
            elif not self.held:
                self._refuse(now_s)
        self._lose_to(commanding)

    def note_applied(self, commanding: int, now_s: float) -> None:
        """Process which lease was in force when a serial frame was written."""
        self._lose_to(commanding)
        if not self.held or commanding == self.number:
            self._ignored_since_s = None
        elif self._ignored_since_s is None:
            self._ignored_since_s = now_s

    def _refuse(self, now_s: float) -> None:
        if self._refused_since_s is None:
            self._refused_since_s = now_s
        elif now_s - self._refused_since_s >= REFUSED_S and not self.take_over:
            self.lost = True

    def _lose_to(self, commanding: int) -> None:
        if self.number and commanding > self.number:
            self.lost = True

    def bid_due(self, now_s: float) -> bool:
        """Return whether to send a bid now, as long as there is no answer."""
        since_s = self._ignored_since_s
        ignored = since_s is not None and now_s - since_s >= IGNORED_S
        if self.lost or now_s < self._bid_at_s or (self.number and not ignored):
            return False
        eager = now_s - self._began_s < EAGER_S
        self._bid_at_s = now_s + (BID_PERIOD_S if eager else LATER_BID_PERIOD_S)
        return True

    def takes_over(self, now_s: float, ready: bool) -> bool:
        """Return whether to bid for the lease of an agent that commands; `ready`: the vehicle is seen."""
        return self.take_over and ready and now_s - self._began_s >= WARM_S

    def next_s(self) -> float:
        """Return when the next bid is due."""
        return math.inf if self.number or self.lost else self._bid_at_s
