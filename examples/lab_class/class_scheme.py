"""Third afternoon: a scheme of one's own.

Vehicles send where they are; followers fly to the last place that they received. Write a better one: what
else do neighbours need, and what follows from the age of a message? What a scheme may do is described in
`docs/arena.md`.
"""

import numpy as np

from rcopterx.vehicles.state import inertial_velocity
from rcopterx_studies.schemes.messages import linked
from rcopterx_studies.schemes.tracked import Moving, SchemePath, TrackedScheme, TrackedSettings


class ClassScheme(TrackedScheme):
    """The cascade tracks the path that `_exchange` chooses."""

    Settings = TrackedSettings
    Message = Moving

    def _exchange(self, situation):
        """Choose the path and return the message. Your answer; this one stands still between messages."""
        reference, leaders = situation.reference, [n for n in linked(situation, Moving) if n.followed]
        if leaders:
            place = np.mean([np.add(n.message.position_m, n.offset_m) for n in leaders], axis=0)
            self._fly(SchemePath(place, np.zeros(3), np.zeros((1, 3)), self.period_s))
        elif not situation.follows:
            self._fly(SchemePath(reference.position_m[0], np.zeros(3), np.zeros((1, 3)), self.period_s))
        motion = situation.estimate.motion
        return Moving.of(motion[:3], inertial_velocity(motion))
