"""Messages of control that others write: programs outside an agent, and schemes of several vehicles."""

from typing import Annotated, Final

from msgspec import Meta

from rcopterx.bus.message import Count, Eight, FloatArray, Four, Message, Name, Period, Place
from rcopterx.bus.messages import MAX_STAGES
from rcopterx.bus.trajectory_array import PLAN_COLUMNS


class ControlTask(Message, frozen=True, kw_only=True):
    """Input of a program outside the agent that flies the vehicle, once every control period."""

    epoch: Count
    frame: Count
    """Epoch and frame of the newest pose behind it."""
    client: Name
    """Program that has to answer."""
    number: Count
    """Counts up; the answer repeats it."""
    period_s: Period
    motion: Eight
    """State when the answer takes effect: x, y, z [m], yaw [rad], body velocities, yaw rate [rad/s]."""
    actuator: Four
    """Inputs after their lag."""
    disturbance: Four
    """Estimated accelerations: body x, body y, z [m/s^2], yaw [rad/s^2]."""
    reference: FloatArray
    """From that moment on, shape (N, 12): x, y, z, yaw, their rates and accelerations, inertial frame."""
    last_input: Four
    """Input in effect until then."""
    hover_input: Four
    """Input at rest."""
    input_gain: Four
    """Acceleration per input: pitch, roll, thrust [m/s^2], yaw [rad/s^2]."""
    input_min: Four
    input_max: Four

    def check(self) -> None:
        """See `Message.check`."""
        self.reference.check("reference", PLAN_COLUMNS, MAX_STAGES, 1)


class ExternalInput(Message, frozen=True, kw_only=True):
    """Answer of a program outside the agent: planned inputs from the moment of the task on."""

    source: Name
    number: Count
    """Number of the task."""
    inputs: FloatArray
    """`period_s` apart, shape (k, 4): pitch, roll, thrust, yaw. Later rows are flown if answers are late."""

    def check(self) -> None:
        """See `Message.check`."""
        self.inputs.check("inputs", 4, MAX_STAGES, 1)


MAX_PAYLOAD_BYTES: Final = 4096


class SchemeMessage(Message, frozen=True, kw_only=True):
    """Message of a vehicle's scheme to those of all others."""

    epoch: Count
    frame: Count
    """Epoch and frame of the control period in which it was sent."""
    source: Name
    scheme: Annotated[str, Meta(max_length=60)]
    """Type of the payload; vehicles with another scheme ignore it."""
    offsets_m: Annotated[dict[Name, Place], Meta(max_length=16)]
    """Where the source should be relative to each of its leaders, inertial frame."""
    payload: Annotated[bytes, Meta(max_length=MAX_PAYLOAD_BYTES)]
    """MessagePack map of the fields that the scheme defines."""
