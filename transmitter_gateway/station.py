"""One transmitter on the bus: takes commands, poses and requests, and says what was written."""

from collections.abc import Callable

from bus import channels
from bus.messages import Applied, Command, Kill, TransmitterStatus
from bus.requests import (
    Arm,
    Disarm,
    KillVehicle,
    RecallTransmitter,
    RecallTransmitterReply,
    Reply,
    ResetKill,
)
from bus.session import Incoming, RequestFailedError, Session
from bus.subscription import Subscription
from transmitter_gateway.inputs import Action, CommandInput, LastWords, PoseInput, Request, State
from transmitter_gateway.serial_port import SerialPort, WriteOutcome
from transmitter_gateway.settings import TransmitterSettings
from transmitter_gateway.transmitter import Transmitter, Write

RECALL_LIMIT_S = 0.2
COMMANDS_KEPT = 256
"""A flood of wrong commands must not push out the right ones between them."""
COMMANDS_AT_ONCE = 8
"""So that a flood for one vehicle keeps no other one waiting."""
VERBS = ["arm", "disarm", "kill", "reset"]


class Station:
    """A transmitter with its subscriptions.

    Parameters
    ----------
    settings
        The vehicle's transmitter.
    session
        Open bus session.
    realtime
        Whether the process runs in the real-time class, for the status.
    """

    def __init__(self, settings: TransmitterSettings, session: Session, realtime: bool) -> None:
        self.vehicle = settings.vehicle
        self._session = session
        self._realtime = realtime
        port = SerialPort(settings.port, settings.protocol.line)
        self.transmitter = Transmitter(
            settings.vehicle,
            settings.limits,
            settings.calibration,
            settings.protocol,
            port,
            low_power=settings.low_power,
        )
        self._commands: Subscription[Command] = session.subscribe(
            channels.COMMAND, self.vehicle, depth=COMMANDS_KEPT
        )
        self._announced: Write | None = None
        self._command_arrived_s: float | None = None
        self._command_fresh: tuple[int, int] | None = None
        self._accepted_s: float | None = None
        self._last_sequence = 0
        session.serve(self.vehicle, VERBS)
        session.announce(self.vehicle, "transmitter")

    def take_commands(self, clock: Callable[[], float]) -> None:
        """Hand a few of the commands to the arbiter, which writes; the last write is not announced yet."""
        for received in self._commands.drain(COMMANDS_AT_ONCE):
            self.announce_write()
            message = received.message
            command = CommandInput(
                source=message.source,
                epoch=message.epoch,
                sequence=message.sequence,
                frame=message.frame,
                u=message.input,
                next_u=message.next_inputs.to_numpy().tolist(),
                period_s=message.period_s,
            )
            self._command_arrived_s = received.arrived_s
            if self.transmitter.on_command(command, clock()).accepted:
                self._accepted_s = received.arrived_s
                self._last_sequence = message.sequence

    @property
    def commands_wait(self) -> bool:
        """Whether there are commands that `take_commands` has left for the next time."""
        return self._commands.waiting_since_s() is not None

    def recall(self) -> None:
        """Ask the launcher what an earlier process of this gateway wrote last, if there was one."""
        asked_s = self._session.clock()
        try:
            reply = self._session.request(
                self.vehicle, RecallTransmitter(), timeout_s=RECALL_LIMIT_S, patience_s=0.0
            )
        except RequestFailedError:
            return
        if isinstance(reply, RecallTransmitterReply) and reply.applied is not None:
            applied = reply.applied
            words = LastWords(
                State(applied.state.upper()), applied.input, asked_s - reply.age_s, holder=reply.lease
            )
            self.transmitter.recall(words, self._session.clock())

    def take_pose(self, pose: PoseInput, now_s: float) -> None:
        """Hand a raw pose of any vehicle to the arbiter."""
        self.transmitter.on_pose(pose, now_s)

    def take_kill(self, kill: Kill, now_s: float) -> None:
        """Obey a kill for this vehicle or for all."""
        if not kill.vehicles or self.vehicle in kill.vehicles:
            self.transmitter.request(Request(Action.KILL, by=kill.source), now_s)

    def answer(self, incoming: Incoming, now_s: float) -> None:
        """Carry out a request and answer it."""
        request = incoming.request
        if isinstance(request, Arm):
            action = Request(Action.ARM, by=request.source, source=request.lease)
        elif isinstance(request, Disarm):
            action = Request(Action.DISARM, by=request.source)
        elif isinstance(request, KillVehicle):
            action = Request(Action.KILL, by=request.source)
        elif isinstance(request, ResetKill):
            action = Request(Action.RESET, by=request.source)
        else:
            incoming.answer(
                Reply(accepted=False, reason=f"a transmitter gateway does not serve {incoming.verb}")
            )
            return
        answer = self.transmitter.request(action, now_s)
        incoming.answer(Reply(accepted=answer.accepted, reason=answer.reason))

    def announce_write(self) -> None:
        """Publish the newest serial frame if it has not been published."""
        write = self.transmitter.last_write
        if write is None or write is self._announced or write.outcome is not WriteOutcome.WRITTEN:
            return
        self._announced = write
        cause = write.output.cause
        identity = None if cause is None else (cause.epoch, cause.sequence)
        fresh = identity is not None and identity != self._command_fresh and not write.output.bridging_step
        self._command_fresh = identity
        self._session.publish(
            channels.APPLIED,
            self.vehicle,
            Applied(
                state=write.output.state.value.lower(),
                input=write.output.u,
                pulse_width_us=write.pulses_us,
                epoch=0 if cause is None else cause.epoch,
                frame=0 if cause is None else cause.frame,
                sequence=0 if cause is None else cause.sequence,
                fresh=fresh,
                command_arrived_s=self._command_arrived_s if fresh else None,
                written_s=write.time_s,
            ),
        )

    def report(self, now_s: float) -> None:
        """Publish the status."""
        status = self.transmitter.status(now_s)
        rejected = {f"command.{kind}": count for kind, count in self._commands.rejected.items()}
        accepted_s = self._accepted_s
        self._session.publish(
            channels.TRANSMITTER_STATUS,
            self.vehicle,
            TransmitterStatus(
                state=status.state.value.lower(),
                reason=status.reason[:400],
                link=status.link.value,
                module=status.module[:400],
                ready=status.link.value == "ready",
                lease=status.holder,
                command_age_s=None if accepted_s is None else max(0.0, now_s - accepted_s),
                last_sequence=self._last_sequence,
                bridging=status.bridging_step > 0,
                counters=dict(status.counters),
                rejected=rejected,
                realtime=self._realtime,
            ),
        )
