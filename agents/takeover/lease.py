"""The control lease of an agent: asked for at start, carried in every command, lost to a later agent."""

import math
from typing import Final

BID_PERIOD_S: Final = 0.01
"""Between two bids; a lost one must not cost a control period."""
EAGER_S: Final = 1.0
LATER_BID_PERIOD_S: Final = 0.1
"""Between two bids of an agent that has asked for longer than `EAGER_S`."""
WARM_S: Final = 2.0
"""How long an agent watches the vehicle before it takes over from the one that flies it."""
REFUSED_S: Final = 0.5
"""An agent that is refused for so long gives up: another one flies its vehicle."""
IGNORED_S: Final = 0.3
"""Commands that have no effect for so long belong to a lease that the gateway has forgotten."""


class ControlLease:
    """Whether this agent may command its vehicle, by what the transmitter gateway says.

    Parameters
    ----------
    now_s
        Now [monotonic s].

    Attributes
    ----------
    number
        The lease; 0 before there is one.
    lost
        Another agent commands: this one says and does nothing any more.
    """

    def __init__(self, agent: int, take_over: bool, now_s: float) -> None:
        self.agent = agent
        self.take_over = take_over
        self.number = 0
        self.lost = False
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
        """Whether another agent speaks for the vehicle, as far as is known."""
        return not self.held and (self.lost or self.take_over or self._refused_since_s is not None)

    def on_answer(self, agent: int, number: int, commanding: int, now_s: float) -> None:
        """Take in an answer of the gateway to a bid, of this agent or of another one.

        Parameters
        ----------
        agent, number
            Whom it is about, and its lease; 0 if it was given none.
        now_s
            Now [monotonic s].
        """
        if agent == self.agent:
            if number:
                self.number, self._refused_since_s, self._ignored_since_s = number, None, None
            elif not self.held:
                self._refuse(now_s)
        self._lose_to(commanding)

    def note_applied(self, commanding: int, now_s: float) -> None:
        """Take in whose commands counted when a serial frame was written."""
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
        """Whether to ask for a lease now, as long as there is no answer."""
        if self.lost or now_s < self._bid_at_s or (self.number and not self._ignored(now_s)):
            return False
        eager = now_s - self._began_s < EAGER_S
        self._bid_at_s = now_s + (BID_PERIOD_S if eager else LATER_BID_PERIOD_S)
        return True

    def _ignored(self, now_s: float) -> bool:
        return self._ignored_since_s is not None and now_s - self._ignored_since_s >= IGNORED_S

    def takes_over(self, now_s: float, ready: bool) -> bool:
        """Whether to ask for the lease of an agent that commands.

        Parameters
        ----------
        now_s
            Now [monotonic s].
        """
        return self.take_over and ready and now_s - self._began_s >= WARM_S

    def next_s(self) -> float:
        """When `bid_due` has to be asked next, as far as time decides [monotonic s]."""
        return math.inf if self.number or self.lost else self._bid_at_s
