"""The one table of channels.

Keys, codecs, liveness, recording, access rules, documentation and tests read it; nobody writes a key string
elsewhere. Figures: zenoh_bus.md section 7.1.
"""

from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from bus import messages
from bus.intent import Intent
from bus.messages import Message

M = TypeVar("M", bound=Message)

ROOT: Final = "rcopterx"
FLEET_UNIT: Final = "fleet"
TRACKER_UNIT: Final = "tracker"
SIMULATOR_UNIT: Final = "simulator"

REAL_TIME: Final = "real_time"
INTERACTIVE_HIGH: Final = "interactive_high"
DATA_HIGH: Final = "data_high"
DATA_LOW: Final = "data_low"


@dataclass(frozen=True)
class Channel(Generic[M]):
    """One row: what travels where, how often, and when it is too old.

    Attributes
    ----------
    topic
        Last chunk of the key `rcopterx/<fleet>/<unit>/<topic>`.
    message
        Type of the message.
    unit
        `vehicle`, `host`, or the fixed unit of the channel.
    publisher
        Role that writes it.
    rate_hz
        Nominal rate; 0 for messages sent on events only.
    stale_after_s
        Age from which the sender counts as silent.
    priority
        Zenoh priority. All channels drop on congestion, none is express.
    recorded
        Whether flight logs keep it.
    purpose
        What it is for, in a line.
    """

    topic: str
    message: type[M]
    unit: str
    publisher: str
    rate_hz: float
    stale_after_s: float
    priority: str
    recorded: bool
    purpose: str

    @property
    def encoding(self) -> str:
        """Zenoh encoding with schema, for instance `application/msgpack;rcopterx.plan.v1`."""
        return f"application/msgpack;{ROOT}.{self.topic}.v{messages.SCHEMA_VERSION}"


POSE: Final = Channel(
    "pose", messages.Pose, "vehicle", "vicon_gateway", 50, 0.04, REAL_TIME, True,
    "where the motion capture sees the vehicle",
)  # fmt: skip
PLAN: Final = Channel(
    "plan", messages.Plan, "vehicle", "agent", 50, 0.1, INTERACTIVE_HIGH, True,
    "predicted trajectory; what followers subscribe to",
)  # fmt: skip
COMMAND: Final = Channel(
    "command", messages.Command, "vehicle", "agent", 50, 0.06, REAL_TIME, True,
    "stick command and the inputs that follow it",
)  # fmt: skip
APPLIED: Final = Channel(
    "applied", messages.Applied, "vehicle", "transmitter_gateway", 50, 0.1, DATA_HIGH, True,
    "what was written to the radio module",
)  # fmt: skip
CONTROL_TASK: Final = Channel(
    "control_task", messages.ControlTask, "vehicle", "agent", 50, 0.1, REAL_TIME, True,
    "state and reference for a controller outside the agent, while one has authority",
)  # fmt: skip
EXTERNAL_INPUT: Final = Channel(
    "external_input", messages.ExternalInput, "vehicle", "external controller", 50, 0.1, REAL_TIME, True,
    "inputs of a controller outside the agent",
)  # fmt: skip
AGENT_STATUS: Final = Channel(
    "status", messages.AgentStatus, "vehicle", "agent", 5, 1.0, DATA_LOW, True,
    "what a vehicle does; solver times and every fallback of its agent",
)  # fmt: skip
INTENT: Final = Channel(
    "intent", Intent, "vehicle", "agent", 5, 3.0, DATA_LOW, True,
    "task and configuration of an agent, for its successor",
)  # fmt: skip
TRANSMITTER_STATUS: Final = Channel(
    "transmitter", messages.TransmitterStatus, "vehicle", "transmitter_gateway", 5, 1.0, DATA_LOW, True,
    "state of the arbiter, the serial port and the radio module",
)  # fmt: skip
TRACKER_STATUS: Final = Channel(
    "status", messages.TrackerStatus, TRACKER_UNIT, "vicon_gateway", 5, 1.0, DATA_LOW, True,
    "connection to the motion capture and the subjects it lists",
)  # fmt: skip
LABORATORY: Final = Channel(
    "laboratory", messages.LaboratoryState, SIMULATOR_UNIT, "simulator", 50, 0.5, DATA_LOW, True,
    "truth of the simulated laboratory, for measurement only",
)  # fmt: skip
LAUNCHER: Final = Channel(
    "launcher", messages.LauncherStatus, "host", "launcher", 2, 2.0, DATA_LOW, True,
    "vehicles that take part, and restarts of processes",
)  # fmt: skip
KILL: Final = Channel(
    "kill", messages.Kill, FLEET_UNIT, "operator", 0, 1.0, REAL_TIME, True,
    "cut the motors of some or all vehicles",
)  # fmt: skip

CHANNELS: Final[tuple[Channel[Message], ...]] = (
    POSE, PLAN, COMMAND, APPLIED, CONTROL_TASK, EXTERNAL_INPUT, AGENT_STATUS, INTENT, TRANSMITTER_STATUS,
    TRACKER_STATUS, LABORATORY, LAUNCHER, KILL,
)  # type: ignore[assignment]  # fmt: skip  # a tuple of differently typed rows


def key(fleet: str, unit: str, topic: str) -> str:
    """Key of a channel of one unit: `rcopterx/<fleet>/<unit>/<topic>`."""
    return f"{ROOT}/{fleet}/{unit}/{topic}"


def request_key(fleet: str, unit: str, verb: str) -> str:
    """Key under which a unit serves a verb."""
    return f"{ROOT}/{fleet}/{unit}/request/{verb}"


def alive_key(fleet: str, unit: str, role: str) -> str:
    """Key of the liveliness token of a role."""
    return f"{ROOT}/{fleet}/{unit}/alive/{role}"
