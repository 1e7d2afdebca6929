"""A scheme of one's own: vehicles send where they are, and followers place themselves beside that.

pip install -e examples/own_scheme
rcopterx arena --schemes courier,cascade --tasks eight,loss_50,delay_100
"""

import numpy as np
from msgspec import Struct

from rcopterx.control.schemes.interface import Situation
from rcopterx.control.schemes.tracked import TrackedScheme, TrackedSettings, Way
from rcopterx.vehicles.state import inertial_velocity, three
from rcopterx.vehicles.tuples import Three


class Position(Struct, frozen=True):
    """Message: position and velocity of the sender, inertial frame."""

    position_m: Three
    velocity_m_s: Three


class CourierScheme(TrackedScheme):
    """Followers fly beside the last known positions of their leaders; the cascade tracks that."""

    Settings = TrackedSettings
    Message = Position

    def _exchange(self, situation: Situation) -> Position:
        motion, reference = situation.estimate.motion, situation.reference
        places = [
            (
                np.array(leader.position_m) + age_s * np.array(leader.velocity_m_s) + offset_m,
                leader.velocity_m_s,
            )
            for _, leader, age_s, offset_m, followed in situation.linked(Position)
            if followed
        ]
        if situation.follows and places:
            place, velocity = np.mean(places, axis=0)
            self._fly(Way(place, velocity, np.zeros((1, 3)), self.period_s))
        elif not situation.follows:
            start = reference.position_m[0], reference.velocity_m_s[0]
            changes = np.diff(reference.velocity_m_s, axis=0) / self.period_s
            self._fly(Way(*start, changes, self.period_s))
        velocity = inertial_velocity(motion)
        return Position(three(motion[:3]), three(velocity))
