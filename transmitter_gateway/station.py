"""One transmitter on the bus: takes commands, poses and requests, and says what was written."""

import math
from collections.abc import Callable
from functools import partial

from rcopterx.bus import channels
from rcopterx.bus.messages import Applied, Command, Kill, Lease, LeaseBid, TransmitterStatus
from rcopterx.bus.requests import (
    Arm,
    Disarm,
    KillVehicle,
    Reply,
    ResetKill,
)
from rcopterx.bus.rounding import PULSE_BITS, all_rounded
from rcopterx.bus.session import Incoming, Session
from rcopterx.bus.subscription import Subscription
from rcopterx.bus.timing import CommandTiming
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    NAMES,
    NEUTRAL,
    Action,
    ActionRequest,
    CommandInput,
    Input,
    State,
)
from rcopterx.transmitter_gateway.serial_port import SerialPort, WriteOutcome
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.snapshot import Write
from rcopterx.transmitter_gateway.transmitter import Transmitter

COMMANDS_KEPT = 256
"""A flood of wrong commands must not push out the right ones between them."""
COMMANDS_AT_ONCE = 8
"""So that a flood for one vehicle keeps no other one waiting."""
BIDS_KEPT = 16
WATCHED_S = 1.0
"""After a bid the agent that made it may watch: it has not commanded what it hears of."""
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
    call
        Called with the station, on receive threads, when there are commands or bids to take.

    Attributes
    ----------
    flies, acts_on_poses : bool
        Whether the vehicle may be in the air, and whether poses decide what it does next, at the last look.
    untold : list of Applied
        Serial frames written that `publish_writes` has not published.
    """

    def __init__(
        self,
        settings: TransmitterSettings,
        session: Session,
        realtime: bool,
        call: Callable[["Station"], None],
    ) -> None:
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
            channels.COMMAND, self.vehicle, depth=COMMANDS_KEPT, wake=partial(call, self)
        )
        self._bids: Subscription[LeaseBid] = session.subscribe(
            channels.LEASE_BID, self.vehicle, depth=BIDS_KEPT, wake=partial(call, self)
        )
        self.flies = False
        self.acts_on_poses = True
        self.untold: list[Applied] = []
        self._news = False
        self._watched_until_s = -math.inf
        self._commanded: Input = NEUTRAL
        self._written_u: Input = NEUTRAL
        self._written_state = State.DISARMED
        self._written_command: tuple[int, int, int] | None = None
        self._told_lease = 0
        self._accepted_s: float | None = None
        self._timing: CommandTiming | None = None
        self._last_sequence = 0
        self._reported_state = self._told_state = State.DISARMED
        session.serve(self.vehicle, VERBS)
        session.announce(self.vehicle, "transmitter")

    def take_commands(self, clock: Callable[[], float]) -> None:
        """Hand a few of the commands to the arbiter; what is written is published by `publish_writes`."""
        for received in self._commands.drain(COMMANDS_AT_ONCE):
            message = received.message
            command = CommandInput(
                lease=message.lease,
                epoch=message.epoch,
                sequence=message.sequence,
                frame=message.frame,
                u=message.input,
                next_u=message.next_inputs.rows(),
                period_s=message.period_s,
            )
            now_s = clock()
            if self.transmitter.on_command(command, now_s).accepted:
                self._accepted_s, self._timing = received.arrived_s, message.timing
                self._last_sequence, self._commanded = message.sequence, message.input
                self.tick(now_s)

    def take_bids(self, now_s: float) -> None:
        """Answer agents that ask for a control lease."""
        arbiter = self.transmitter.arbiter
        if self.transmitter.awaiting_recall:
            return  # Which leases were issued before is not known yet.
        for received in self._bids.drain():
            bid, self._watched_until_s = received.message, now_s + WATCHED_S
            number = arbiter.bid(bid.agent, now_s, take_over=bid.take_over)
            self._publish_lease(bid.agent, number)

    def tell_lease(self) -> None:
        """Tell everybody if another agent commands."""
        if self.transmitter.arbiter.lease != self._told_lease:
            self._publish_lease(0, 0)

    def _publish_lease(self, agent: int, number: int) -> None:
        arbiter = self.transmitter.arbiter
        self._told_lease = arbiter.lease
        lease = Lease(agent=agent, number=number, commanding=arbiter.lease, issued=arbiter.issued)
        self._session.publish(channels.LEASE, self.vehicle, lease)

    @property
    def commands_wait(self) -> bool:
        """Whether there are commands that `take_commands` has left for the next time."""
        return self._commands.waiting_since_s() is not None

    def look(self, now_s: float) -> None:
        """Let the transmitter do what is due, and tell another state at once; needed from its `due_s` on."""
        transmitter = self.transmitter
        if now_s >= transmitter.next_deadline_s():
            self.tick(now_s)
            transmitter.next_deadline_s()
        state = transmitter.arbiter.state
        if state is not self._told_state:
            self.publish_writes()
        self.flies, self.acts_on_poses = state in FLYING, transmitter.acts_on_poses

    def tick(self, now_s: float) -> None:
        """Let the transmitter do what is due; what is written is published by `publish_writes`."""
        write = self.transmitter.tick(now_s)
        if write is not None and write.outcome is WriteOutcome.WRITTEN:
            applied, output = self._applied(write), write.output
            expected = self._commanded if applied.fresh else self._written_u
            as_expected = output.u == expected and not output.bridging_step
            same_state = output.state is self._written_state
            self._news = self._news or not (as_expected and same_state and now_s >= self._watched_until_s)
            self._written_u, self._written_state = output.u, output.state
            self.untold.append(applied)

    def take_kill(self, kill: Kill, now_s: float) -> None:
        """Obey a kill for this vehicle or for all."""
        if not kill.vehicles or self.vehicle in kill.vehicles:
            self.transmitter.request(ActionRequest(Action.KILL, by=kill.source), now_s)

    def answer(self, incoming: Incoming, now_s: float) -> None:
        """Carry out a request and answer it."""
        request = incoming.request
        if isinstance(request, Arm):
            action = ActionRequest(Action.ARM, by=request.source)
        elif isinstance(request, Disarm):
            action = ActionRequest(Action.DISARM, by=request.source)
        elif isinstance(request, KillVehicle):
            action = ActionRequest(Action.KILL, by=request.source)
        elif isinstance(request, ResetKill):
            action = ActionRequest(Action.RESET, by=request.source)
        else:
            incoming.answer(
                Reply(accepted=False, reason=f"a transmitter gateway does not serve {incoming.verb}")
            )
            return
        answer = self.transmitter.request(action, now_s)
        incoming.answer(Reply(accepted=answer.accepted, reason=answer.reason))

    @property
    def has_news(self) -> bool:
        """Whether `publish_writes` has something to tell that the agent that commands does not know already.

        It knows what is written as it was commanded, and what is repeated because no command has come.
        """
        return self._news

    def publish_writes(self) -> None:
        """Publish the serial frames written since the last call, and at once that a kill begins or ends."""
        for applied in self.untold:
            self._session.publish(channels.APPLIED, self.vehicle, applied)
        self.untold.clear()
        self._news = False
        self._told_state = self.transmitter.arbiter.state
        before, now = self._reported_state, self._told_state
        if before is not now and State.KILLED in (before, now):
            self.report(self._session.clock())

    def _applied(self, write: Write) -> Applied:
        cause = write.output.cause
        identity = None if cause is None else (cause.lease, cause.epoch, cause.sequence)
        fresh = identity is not None and identity != self._written_command and not write.output.bridging_step
        self._written_command = identity
        return Applied(
            state=NAMES[write.output.state],
            input=write.output.u,
            pulse_width_us=all_rounded(write.pulses_us, PULSE_BITS),
            epoch=0 if cause is None else cause.epoch,
            frame=0 if cause is None else cause.frame,
            sequence=0 if cause is None else cause.sequence,
            lease=self.transmitter.arbiter.lease,
            fresh=fresh,
            command_arrived_s=self._accepted_s if fresh else None,
            written_s=write.time_s,
            host=self._session.address.host or None,
            timing=self._timing if fresh else None,
        )

    def report(self, now_s: float) -> None:
        """Publish the status."""
        snapshot = self.transmitter.snapshot(now_s)
        self._reported_state = snapshot.state
        rejected = {f"command.{kind}": count for kind, count in self._commands.rejected.items()}
        accepted_s = self._accepted_s
        self._session.publish(
            channels.TRANSMITTER_STATUS,
            self.vehicle,
            TransmitterStatus(
                state=NAMES[snapshot.state],
                reason=snapshot.reason[:400],
                link=snapshot.link.value,
                module=snapshot.module[:400],
                ready=snapshot.link.value == "ready",
                lease=snapshot.lease,
                command_age_s=None if accepted_s is None else max(0.0, now_s - accepted_s),
                last_sequence=self._last_sequence,
                bridging=snapshot.bridging_step > 0,
                counters=dict(snapshot.counters),
                rejected=rejected,
                realtime=self._realtime,
            ),
        )
