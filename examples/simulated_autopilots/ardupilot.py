"""Show the true states of ArduPilot in software (SITL) as a Tracker does.

python examples/simulated_autopilots/ardupilot.py quad1=udpin:127.0.0.1:14550 quad2=udpin:127.0.0.1:14551
"""

from functools import partial
from typing import Any

from pymavlink.dialects.v20 import common as mavlink
from truth import MavlinkTruth, Origin, TrueState, main


def state_of(message: Any) -> TrueState:
    """True state of a `SIM_STATE`, which SITL sends on request."""
    rotation = (message.q1, message.q2, message.q3, message.q4)
    velocity_m_s = (message.vn, message.ve, message.vd)
    return TrueState(1e-7 * message.lat_int, 1e-7 * message.lon_int, message.alt, rotation, velocity_m_s)


def vehicle(text: str, origin: Origin | None = None) -> MavlinkTruth:
    """A vehicle `SUBJECT=LINK`; without an origin it is its own."""
    return MavlinkTruth(text, mavlink.MAVLINK_MSG_ID_SIM_STATE, state_of, origin)


if __name__ == "__main__":
    main(__doc__, partial(vehicle, origin=Origin()), "SUBJECT=LINK")
