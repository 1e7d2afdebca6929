"""A scheme of one's own: vehicles send where they are, and followers place themselves beside that.

pip install -e examples/own_scheme
rcopterx arena --schemes courier,cascade --tasks eight,loss_50,delay_100

A message is a `msgspec.Struct` of plain fields; `Moving` has a place and its velocity.
"""

import numpy as np

from rcopterx.control.scheme import Situation
from rcopterx.vehicles.state import inertial_velocity
from rcopterx_studies.schemes.messages import linked
from rcopterx_studies.schemes.tracked import Moving, SchemePath, TrackedScheme, TrackedSettings


class CourierScheme(TrackedScheme):
    """Followers fly beside the last known positions of their leaders; the cascade tracks that."""

    Settings = TrackedSettings
    Message = Moving

    def _exchange(self, situation: Situation) -> Moving:
        motion, reference = situation.estimate.motion, situation.reference
        leaders = [link for link in linked(situation, Moving) if link.followed]
        if situation.follows and leaders:
            place, velocity = np.mean([link.message.after(link.age_s) for link in leaders], axis=0)
            place += np.mean([link.offset_m for link in leaders], axis=0)
            self._fly(SchemePath(place, velocity, np.zeros((1, 3)), self.period_s))
        elif not situation.follows:
            start = reference.position_m[0], reference.velocity_m_s[0]
            changes = np.diff(reference.velocity_m_s, axis=0) / self.period_s
            self._fly(SchemePath(*start, changes, self.period_s))
        return Moving.of(motion[:3], inertial_velocity(motion))
