"""The one table of channels, for codecs, liveness, recording, access rules, documentation and tests."""

from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from rcopterx.bus import host_messages, log_messages, messages
from rcopterx.bus.external_messages import ControlTask, ExternalInput, SchemeMessage
from rcopterx.bus.host_messages import Beat, RouterStatus
from rcopterx.bus.intent import Intent
from rcopterx.bus.keys import EVERY_FLEET as EVERY_FLEET
from rcopterx.bus.keys import FLEET_UNIT as FLEET_UNIT
from rcopterx.bus.keys import KILL_TOPIC, ROOT, TRANSMITTER_TOPIC
from rcopterx.bus.keys import SIMULATOR_UNIT as SIMULATOR_UNIT
from rcopterx.bus.keys import TRACKER_UNIT as TRACKER_UNIT
from rcopterx.bus.keys import key as key
from rcopterx.bus.keys import request_key as request_key
from rcopterx.bus.message import SCHEMA_VERSION, Message
from rcopterx.bus.requests import EXTERNAL

M = TypeVar("M", bound=Message)

REAL_TIME: Final = "real_time"
INTERACTIVE_HIGH: Final = "interactive_high"
DATA_HIGH: Final = "data_high"
DATA_LOW: Final = "data_low"


@dataclass(frozen=True)
class Channel(Generic[M]):
    """One row: what travels where, how often, and when it is too old."""

    topic: str  # last chunk of the key `rcopterx/<fleet>/<unit>/<topic>`
    message: type[M]
    unit: str  # `vehicle`, `host`, or the fixed unit of the channel
    publisher: str  # role that publishes it
    rate_hz: float  # nominal rate; 0 for messages on events only
    stale_after_s: float  # age from which the sender counts as silent
    priority: str  # name of a Zenoh priority. All channels drop on congestion, none is express.
    recorded: bool = True  # whether flight logs keep it

    @property
    def encoding(self) -> str:
        """Zenoh encoding with schema, for instance `application/msgpack;rcopterx.plan.v2`."""
        return f"application/msgpack;{ROOT}.{self.topic}.v{SCHEMA_VERSION}"


POSE: Final = Channel("pose", messages.Pose, "vehicle", "vicon_gateway", 50, 0.04, REAL_TIME)
PLAN: Final = Channel("plan", messages.Plan, "vehicle", "agent", 50, 0.1, INTERACTIVE_HIGH)
SCHEME: Final = Channel("scheme", SchemeMessage, "vehicle", "agent", 50, 1.0, INTERACTIVE_HIGH)
COMMAND: Final = Channel("command", messages.Command, "vehicle", "agent", 50, 0.06, REAL_TIME)
LEASE_BID: Final = Channel("lease_bid", messages.LeaseBid, "vehicle", "agent", 0, 1.0, REAL_TIME)
LEASE: Final = Channel("lease", messages.Lease, "vehicle", "transmitter_gateway", 0, 1.0, REAL_TIME)
APPLIED: Final = Channel("applied", messages.Applied, "vehicle", "transmitter_gateway", 50, 0.2, DATA_HIGH)
CONTROL_TASK: Final = Channel("control_task", ControlTask, "vehicle", "agent", 50, 0.1, REAL_TIME)
EXTERNAL_INPUT: Final = Channel("external_input", ExternalInput, "vehicle", EXTERNAL, 50, 0.1, REAL_TIME)
AGENT_STATUS: Final = Channel("status", messages.AgentStatus, "vehicle", "agent", 5, 1.0, DATA_LOW)
INTENT: Final = Channel("intent", Intent, "vehicle", "agent", 5, 3.0, DATA_LOW)
TRANSMITTER_STATUS: Final = Channel(
    TRANSMITTER_TOPIC, messages.TransmitterStatus, "vehicle", "transmitter_gateway", 5, 1.0, DATA_LOW
)
TRACKER_STATUS: Final = Channel(
    "status", host_messages.TrackerStatus, TRACKER_UNIT, "vicon_gateway", 5, 1.0, DATA_LOW
)
LABORATORY: Final = Channel(
    "laboratory", host_messages.LaboratoryState, SIMULATOR_UNIT, "simulator", 50, 0.5, DATA_LOW
)
LAUNCHER: Final = Channel("launcher", host_messages.LauncherStatus, "host", "launcher", 2, 2.0, DATA_LOW)
BEAT: Final = Channel("beat", Beat, "host", "router", 12.5, 0.32, REAL_TIME, recorded=False)
ROUTER_STATUS: Final = Channel("links", RouterStatus, "host", "router", 2, 2.0, DATA_LOW)
KILL: Final = Channel(KILL_TOPIC, messages.Kill, FLEET_UNIT, "operator", 0, 1.0, REAL_TIME)

ANSWERED: Final = Channel(
    "answered", log_messages.AnsweredRequest, "vehicle", "server of the request", 0, 1.0, DATA_LOW
)
LAUNCHER_EVENT: Final = Channel("event", log_messages.LauncherEvent, "host", "launcher", 0, 1.0, DATA_LOW)
AGENT_STEPS: Final = Channel("steps", log_messages.AgentSteps, "vehicle", "agent", 50, 0.5, DATA_LOW)
CALLS: Final = Channel("calls", log_messages.ArbiterCalls, "vehicle", "transmitter_gateway", 5, 1.0, DATA_LOW)
RECORDER: Final = Channel("recorder", log_messages.RecorderStatus, "host", "recorder", 1, 3.0, DATA_LOW)

FIXED_UNITS: Final = (TRACKER_UNIT, SIMULATOR_UNIT, FLEET_UNIT)
CHANNELS: Final[tuple[Channel[Message], ...]] = (
    POSE, PLAN, SCHEME, COMMAND, LEASE_BID, LEASE, APPLIED, CONTROL_TASK, EXTERNAL_INPUT, AGENT_STATUS,
    INTENT, TRANSMITTER_STATUS, TRACKER_STATUS, LABORATORY, LAUNCHER, BEAT, ROUTER_STATUS, KILL, ANSWERED,
    LAUNCHER_EVENT, RECORDER, AGENT_STEPS, CALLS,
)  # type: ignore[assignment]  # fmt: skip  # a tuple of differently typed rows
