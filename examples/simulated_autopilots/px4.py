"""Show the true states of PX4 in software (SIH) as a Tracker does.

python examples/simulated_autopilots/px4.py quad1=udpin:127.0.0.1:19410 quad2=udpin:127.0.0.1:19411
"""

from functools import partial
from typing import Any

from pymavlink.dialects.v20 import common as mavlink
from truth import MavlinkTruth, Origin, TrueState, main

RATE_HZ = 200.0  # PX4 tilts quickly: an older rotation makes its tilt swing


def state_of(message: Any) -> TrueState:
    """True state of a `HIL_STATE_QUATERNION`, which PX4 fills from its ground truth."""
    rotation = message.attitude_quaternion
    velocity_m_s = (0.01 * message.vx, 0.01 * message.vy, 0.01 * message.vz)
    return TrueState(1e-7 * message.lat, 1e-7 * message.lon, 1e-3 * message.alt, rotation, velocity_m_s)


def vehicle(text: str, origin: Origin | None = None) -> MavlinkTruth:
    """A vehicle `SUBJECT=LINK`; without an origin it is its own."""
    return MavlinkTruth(text, mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, state_of, origin, RATE_HZ)


if __name__ == "__main__":
    main(__doc__, partial(vehicle, origin=Origin()), "SUBJECT=LINK")
