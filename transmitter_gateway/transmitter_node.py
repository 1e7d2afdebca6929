"""One transmitter on the bus: takes commands and requests, and publishes written frames."""

from collections.abc import Callable

from rcopterx.bus import channels
from rcopterx.bus.messages import Applied, Command, Kill, Lease, TransmitterStatus
from rcopterx.bus.requests import Reply, SetLight
from rcopterx.bus.rounding import PULSE_BITS, all_rounded
from rcopterx.bus.session import Incoming, Session
from rcopterx.bus.subscription import Received
from rcopterx.transmitter_gateway.inputs import (
    NAMES,
    Action,
    ActionRequest,
    Cause,
    CommandInput,
    LinkState,
    State,
)
from rcopterx.transmitter_gateway.port import Write, WriteOutcome
from rcopterx.transmitter_gateway.transmitter import Transmitter

COMMANDS_KEPT = 256  # a flood of wrong commands must not push out the right ones between them
COMMANDS_AT_ONCE = 8  # so that a flood for one vehicle keeps no other one waiting
BIDS_KEPT = 16
NO_CAUSE = Cause(0, 0, 0, 0)  # of outputs that no command is behind
VERBS = ["arm", "disarm", "kill", "reset", "set_light"]  # the first ones are actions of their names


class TransmitterNode:
    """A transmitter with its subscriptions, which wake the loop of `session`."""

    def __init__(self, transmitter: Transmitter, session: Session, realtime: bool) -> None:
        self.vehicle = transmitter.vehicle
        self.transmitter = transmitter
        self._session = session
        self._realtime = realtime
        self._commands = session.subscribe(channels.COMMAND, self.vehicle, depth=COMMANDS_KEPT)
        self._bids = session.subscribe(channels.LEASE_BID, self.vehicle, depth=BIDS_KEPT)
        self._published_lease = 0
        self._reported_state = State.DISARMED
        self._written_cause = NO_CAUSE
        self._accepted: Received[Command] | None = None
        session.serve(self.vehicle, VERBS)

    def take_commands(self, clock: Callable[[], float]) -> None:
        """Pass some commands to the arbiter, and write accepted ones at once."""
        for received in self._commands.drain(COMMANDS_AT_ONCE):
            command, now_s = command_input(received.message), clock()
            if self.transmitter.on_command(command, now_s).accepted:
                self._accepted = received
                self._tick(now_s)

    @property
    def commands_wait(self) -> bool:
        """Whether `take_commands` has left commands for the next time."""
        return self._commands.waiting_since_s() is not None

    def take_bids(self, now_s: float) -> None:
        """Answer agents that request a control lease."""
        if self.transmitter.undecided:
            return
        for received in self._bids.drain():
            bid = received.message
            self._publish_lease(bid.agent, self.transmitter.bid(bid.agent, now_s, take_over=bid.take_over))

    def _publish_lease(self, agent: int, number: int) -> None:
        leases = self.transmitter.arbiter.leases
        self._published_lease = leases.commanding
        lease = Lease(agent=agent, number=number, commanding=leases.commanding, issued=leases.issued)
        self._session.publish(channels.LEASE, self.vehicle, lease)

    def serve(self, now_s: float) -> None:
        """Do what is due, and publish at once that another agent commands or that a kill begins or ends."""
        if now_s >= self.transmitter.next_deadline_s():
            self._tick(now_s)
        arbiter = self.transmitter.arbiter
        if arbiter.leases.commanding != self._published_lease:
            self._publish_lease(0, 0)
        if (arbiter.state is State.KILLED) != (self._reported_state is State.KILLED):
            self.report(now_s)

    def _tick(self, now_s: float) -> None:
        write = self.transmitter.tick(now_s)
        if write is not None and write.outcome is WriteOutcome.WRITTEN:
            self._session.publish(channels.APPLIED, self.vehicle, self._applied(write))

    def take_kill(self, kill: Kill, now_s: float) -> None:
        """Obey a kill for this vehicle or for all."""
        if not kill.vehicles or self.vehicle in kill.vehicles:
            self.transmitter.request(ActionRequest(Action.KILL, by=kill.source), now_s)

    def answer(self, incoming: Incoming, now_s: float) -> None:
        """Carry out a request and answer it."""
        if isinstance(incoming.request, SetLight):
            shown, radio = self.transmitter.protocol.light(incoming.request.colour), self.transmitter.protocol
            incoming.answer(Reply(accepted=shown, reason="" if shown else f"{radio.name}: no lights"))
            return
        request = ActionRequest(Action(incoming.verb), by=incoming.request.source)
        answer = self.transmitter.request(request, now_s)
        incoming.answer(Reply(accepted=answer.accepted, reason=answer.reason))

    def _applied(self, write: Write) -> Applied:
        cause = write.output.cause or NO_CAUSE
        fresh = write.output.commanded and cause != self._written_cause
        self._written_cause = cause
        accepted = self._accepted if fresh else None
        return Applied(
            state=NAMES[write.output.state],
            input=write.output.u,
            pulse_width_us=all_rounded(write.pulses_us, PULSE_BITS),
            epoch=cause.epoch,
            frame=cause.frame,
            sequence=cause.sequence,
            lease=self.transmitter.arbiter.leases.commanding,
            fresh=fresh,
            command_arrived_s=None if accepted is None else accepted.arrived_s,
            written_s=write.time_s,
            host=self._session.address.host or None,
            timing=None if accepted is None else accepted.message.timing,
        )

    def report(self, now_s: float) -> None:
        """Publish the status."""
        transmitter, arbiter = self.transmitter, self.transmitter.arbiter
        link = transmitter.link(now_s)
        self._reported_state = arbiter.state
        rejected = {f"command.{kind}": count for kind, count in self._commands.rejected.items()}
        accepted, track = self._accepted, arbiter.pose_monitor.own_track
        counters = arbiter.counters, transmitter.port.counters, transmitter.protocol.counters
        self._session.publish(
            channels.TRANSMITTER_STATUS,
            self.vehicle,
            TransmitterStatus(
                state=NAMES[arbiter.state],
                reason=arbiter.reason[:400],
                link=link.state.value,
                module=link.text[:400],
                ready=link.state is LinkState.READY,
                armed=link.armed,
                battery=transmitter.battery.status,
                lease=arbiter.leases.commanding,
                command_age_s=None if accepted is None else max(0.0, now_s - accepted.arrived_s),
                pose_age_s=None if track is None else max(0.0, now_s - track.arrived_s),
                bridging=transmitter.output.bridging_step > 0,
                counters={str(name): count for each in counters for name, count in each.items()},
                rejected=rejected,
                realtime=self._realtime,
                pose_problems=tuple(line[:400] for line in arbiter.standing.problems(now_s)),
            ),
        )


def command_input(command: Command) -> CommandInput:
    """Command in the form of the arbiter."""
    return CommandInput(
        lease=command.lease,
        epoch=command.epoch,
        sequence=command.sequence,
        frame=command.frame,
        u=command.input,
        next_u=command.next_inputs.rows(),
        period_s=command.period_s,
        given_up=command.given_up,
    )
