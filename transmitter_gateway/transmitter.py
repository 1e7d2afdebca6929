"""One transmitter: arbiter, calibration, radio protocol and port, driven by a single-threaded loop.

The loop calls `on_command`, `on_pose`, `on_readable` and `request` when something arrives, and `tick` at the
latest at `next_deadline_s`, which is at once after any of these. Only `tick` decides and writes, and it
returns what it wrote. Accepted commands are written on arrival; without one the arbiter's output is repeated.
"""

import math
from collections.abc import Sequence

from msgspec import structs

from rcopterx.radios.protocol import FrameFlags, ModuleStatus
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.battery import BatteryWatch
from rcopterx.transmitter_gateway.binding import Binding
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    NEUTRAL,
    Action,
    ActionRequest,
    Answer,
    ArbiterOutput,
    CommandInput,
    LastApplied,
    Link,
    LinkState,
    PoseInput,
    State,
)
from rcopterx.transmitter_gateway.journal import Journal
from rcopterx.transmitter_gateway.port import Port, Write, WriteOutcome
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.state_page import StatePage
from rcopterx.transmitter_gateway.switches import Arming, channels_of, prepare_channels, shown_channels
from rcopterx.transmitter_gateway.take_over import seen_on_floor, take_over_problem

THROTTLE_LOW_FRAMES = 30  # at least 25 are to arrive
FAREWELL_FRAME = 26  # of them, after which the firmware may restart; ports send it before they are closed
REPOWERED_S = 7.0  # until a receiver finds a module that lost power (2 to 6 s); the vehicle has fallen
LEASES_PER_S = 1000  # of a second at most: a restarted gateway that lost them continues from here


class Transmitter:
    """Flies one vehicle through one port, which the first `tick` opens.

    The calibration's slew rates and hover thrust also serve the arbiter. Raises `PulseRangeError` if the
    calibration can give a pulse width that the protocol cannot carry, and `ProtocolError` if low power is
    requested and the radio has none.
    """

    def __init__(self, settings: TransmitterSettings, port: Port, journal: Journal | None = None) -> None:
        calibration, protocol = settings.calibration, settings.protocol
        hover, slew_per_s = calibration.throttle.u_hover, calibration.slew_per_s
        self.vehicle, self._journal = settings.vehicle, journal or Journal()
        self.arbiter = Arbiter(settings.vehicle, settings.limits, hover, slew_per_s)
        self.protocol, self.port = protocol, port
        self._calibration = calibration
        self._arming: Arming | None = None
        self._low_power = settings.low_power
        protocol.check_flags(FrameFlags(low_power=settings.low_power))
        prepare_channels(protocol, calibration, settings.limits)
        self.output = ArbiterOutput(State.DISARMED)  # newest decision
        self._pending = self._due_now = False
        self._binding = Binding(at_power_up=protocol.binds_at_power_up)
        self.battery = BatteryWatch(settings.battery, hover)
        self._range_check = self._shutdown = self._ready = False
        self._low_frames = 0
        self._shown: tuple[float, ...] = ()
        self._shown_until_s = self._unknown_until_s = -math.inf
        self._page: StatePage | None = None
        self._written_u = NEUTRAL
        self._attempt_s = self._written_s = self._returned_s = self._opened_s = -math.inf
        self._last: LastApplied | None = None

    def on_command(self, command: CommandInput, now_s: float) -> Answer:
        """Take a command; an accepted one is written by the next `tick`, if it flies the vehicle."""
        self._journal.note("command", self.vehicle, now_s, command.lease, command.sequence)
        answer = self.arbiter.command(command, now_s)
        if answer.accepted:
            self._save()
            self._decide_at_once(urgent=self.arbiter.commanded)
        return answer

    def on_pose(self, pose: PoseInput, now_s: float, explained_m: float = math.inf) -> None:
        """Take a raw pose that arrived at `now_s`, see `Arbiter.pose`; the next `tick` judges the own one."""
        self.arbiter.pose(pose, now_s, explained_m)
        if pose.vehicle == self.vehicle:
            if pose.position_m is not None and pose.yaw_rad is not None:
                standing = self.arbiter.state not in FLYING and self._on_floor
                self.protocol.pose_seen(pose.position_m, pose.yaw_rad, standing=standing)
            self._decide_at_once()

    def on_readable(self, now_s: float) -> None:
        """Read the module's answers; call it when the port's descriptor is readable or hung up."""
        if data := self.port.read_available(now_s):
            self.protocol.receive(data, now_s)
        self._decide_at_once()

    def request(self, request: ActionRequest, now_s: float) -> Answer:
        """Carry out or refuse a request; a shutdown also ends this transmitter, see `finished`."""
        if request.action is Action.SHUTDOWN:
            self._shutdown = True
        self._journal.note("request", self.vehicle, now_s, request.action, request.by)
        answer = self.arbiter.request(request, now_s)
        if request.action is Action.RESET and request.by in self.arbiter.limits.operators:
            standing = self.arbiter.state in (State.DISARMED, State.CUT)
            recovery = self.protocol.recover() if standing else None
            answer = answer if recovery is None else Answer(True, recovery)
        if self.arbiter.state is not State.DISARMED:
            self._last, self._unknown_until_s = None, -math.inf
        self._save()
        self._decide_at_once()
        return answer

    def bid(self, agent: int, now_s: float, *, take_over: bool) -> int:
        """Issue a control lease; see `Leases.bid`."""
        number = self.arbiter.bid(agent, now_s, take_over=take_over)
        self._journal.note("bid", self.vehicle, now_s, agent, take_over, number)
        self._save()
        return number

    def resume(self, page: StatePage, now_s: float) -> None:
        """Continue from what an earlier process wrote last, and keep the page up to date from now on.

        A kill stays a kill. A flight continues as soon as the port is open. If nothing is known, nothing is
        written until the own pose shows whether the vehicle flies, but not for longer than `take_over_s`.
        """
        self._page = page
        last = page.last
        leases = (0, round(LEASES_PER_S * now_s)) if last is None else (last.lease, last.issued)
        self._journal.note("resume", self.vehicle, now_s, *leases)
        self.arbiter.leases.resume(*leases, now_s)
        if last is None:
            self.arbiter.counters["last state unknown"] += 1
            self._unknown_until_s = now_s + self.arbiter.limits.take_over_s
            return
        self._written_u, self._written_s = last.u, last.written_s
        self.protocol.watched = last.watched
        self._decide_at_once()
        if last.state is State.KILLED:
            self.request(ActionRequest(Action.KILL, by="an earlier process"), now_s)
        elif last.state in FLYING:
            self._last, self._ready = last, last.ready

    def _save(self) -> None:
        """Write what a successor needs before it shows outside, but not before a take-over is decided."""
        if self._page is not None and not self.undecided and (last := self._applied()) != self._page.last:
            self._page.save(last)

    def _applied(self) -> LastApplied:
        arbiter = self.arbiter
        return LastApplied(
            arbiter.state,
            self._written_u,
            self._written_s,
            arbiter.leases.commanding,
            arbiter.leases.issued,
            arbiter.hover.value,
            # A successor continues a shutdown.
            commanded=arbiter.commanded and not self._shutdown,
            mistaken=arbiter.pose_monitor.mistaken,
            ready=self._ready,
            grounded=arbiter.grounded,
            watched=self.protocol.watched,
            lifted=arbiter.lift_off.proved,
            hover_known_s=arbiter.hover.known_s,
            track=arbiter.pose_monitor.believed if arbiter.state in FLYING else None,
        )

    @property
    def undecided(self) -> bool:
        """Whether it is not decided yet if the vehicle of an earlier process is taken over."""
        return self._last is not None or self._unknown_until_s > -math.inf

    def _decide(self, now_s: float) -> None:
        """Take the vehicle over if it flies, once its pose is known and the port is open."""
        track = self.arbiter.pose_monitor.own_track
        seen = track is not None and track.position_m is not None
        if seen and now_s < self._unknown_until_s:
            self._written_u, self._written_s = (0.0, 0.0, self.arbiter.hover.value, 0.0), now_s
            self._last = structs.replace(self._applied(), state=State.LAND, grounded=False)
        if seen or now_s >= self._unknown_until_s:
            self._unknown_until_s = -math.inf
        if (last := self._last) is None:
            return
        if self.port.service(now_s):
            self._open_link(now_s)
        if self.port.is_open or now_s >= self._too_late_s:
            self._last = None
            self._judge_link(now_s)
            self._journal.note("take_over", self.vehicle, now_s, *structs.astuple(last))
            self.arbiter.take_over(last, now_s)

    def bind(self, now_s: float) -> Answer:
        """Start binding: bind frames until the module is done, then 5 s of neutral frames.

        A board that reads the flag only when it is switched on is waited for; its port may vanish then.
        """
        if self.arbiter.state is not State.DISARMED:
            return Answer(False, f"binding is only possible while DISARMED, not {self.arbiter.state}")
        if "bind" not in self.protocol.offers:
            return Answer(False, f"{self.protocol.name}: bind with the radio itself")
        if not self.port.is_open:
            return Answer(False, f"binding is not possible: {self.port.problem}")
        self._binding.begin(now_s)
        self._decide_at_once(urgent=True)
        return Answer(True, "binding")

    def range_check(self, wanted: bool) -> Answer:
        """Switch the reduced range-check power on or off; while it is on, arming is refused."""
        if self.arbiter.state is not State.DISARMED:
            return Answer(False, f"range check is only possible while DISARMED, not {self.arbiter.state}")
        if "range_check" not in self.protocol.offers:
            return Answer(False, f"{self.protocol.name}: check the range with the radio itself")
        self._range_check = wanted
        self._decide_at_once(urgent=True)
        return Answer(True, "range check on" if wanted else "range check off")

    def show(
        self, u: Sequence[float] | None, *, throttle_us: float | None = None, until_s: float = math.inf
    ) -> Answer:
        """Send these inputs while DISARMED, for calibration; None ends it. Meanwhile arming is refused.

        `throttle_us` is between throttle low and full throttle of the calibration; with it the arming channel
        is on, without it the throttle is low.
        """
        if self.arbiter.state is not State.DISARMED:
            return Answer(False, f"calibration is only possible while DISARMED, not {self.arbiter.state}")
        low_us, full_us = self._calibration.throttle.low_us, self._calibration.throttle.us1
        if throttle_us is not None and not low_us <= throttle_us <= full_us:
            return Answer(False, f"throttle {throttle_us:g} us is outside {low_us:g} .. {full_us:g}")
        self._shown_until_s = -math.inf if u is None else until_s
        if u is not None:
            self._shown = shown_channels(self._calibration, u, throttle_us)
        self._decide_at_once(urgent=True)
        return Answer(True, "shown")

    def busy(self, now_s: float) -> bool:
        """Whether binding, a range check or a calibration blocks arming."""
        return self._binding.busy(now_s) or self._range_check or now_s < self._shown_until_s

    def link(self, now_s: float) -> Link:
        """Way to the vehicle."""
        module = self.protocol.status(now_s)
        state = self._link(module, now_s) if self.port.is_open else LinkState.LOST
        return Link(state, self._text(module, now_s), module.armed)

    def _link(self, module: ModuleStatus, now_s: float) -> LinkState:
        """Way to the vehicle while the port is open."""
        flying = self.arbiter.state in FLYING
        waits = self.busy(now_s) or self._searched(now_s)
        overloaded = not flying and self.port.overload is not None
        weak = self.battery.problem(flying=flying) is not None
        return LinkState.READY if module.ready and not (waits or overloaded or weak) else LinkState.UP

    def _searched(self, now_s: float) -> bool:
        """Whether a receiver still searches: its board has to see the arming channel off."""
        until_s = self._opened_s + self.protocol.receiver_search_s
        return self._calibration.arming is not None and now_s < until_s

    def _decide_at_once(self, *, urgent: bool = False) -> None:
        """Make the next `tick` due now; an urgent frame does not wait for the keep-alive."""
        self._due_now = True
        self._pending = self._pending or urgent

    def tick(self, now_s: float) -> Write | None:
        """Do everything that is due and return the written frame, if any."""
        self._due_now = False
        if self.undecided:
            self._decide(now_s)
        write = None if self.undecided else self._advance(now_s)
        self._save()
        return write

    def _advance(self, now_s: float) -> Write | None:
        """Serve the port, step the arbiter, and write a frame if one is due."""
        over = None
        if self.port.service(now_s):
            self._binding.link_opened(now_s)
            over = self._flight_over(now_s) if self.arbiter.state in FLYING else None
            self._open_link(now_s)
            self._pending = True
        self._judge_link(now_s, over)
        self._journal.note("step", self.vehicle, now_s)
        before, self.output = self.output, self.arbiter.step(now_s)
        changed = before.state is not self.output.state
        self._pending = self._pending or changed or self.output.bridging_step > before.bridging_step
        if self.port.is_open and now_s >= self._due_s():
            return self._write(now_s)
        return None

    def next_deadline_s(self) -> float:
        """When `tick` must be called at the latest [s]."""
        if self._due_now:
            return -math.inf
        if self._unknown_until_s > -math.inf:
            return self._unknown_until_s
        away = not self.port.is_open and (self._last is not None or self.arbiter.state in FLYING)
        too_late_s = self._too_late_s if away else math.inf
        return min(self.port.next_attempt_s, self._due_s(), self.arbiter.next_event_s(), too_late_s)

    @property
    def finished(self) -> bool:
        """After a shutdown request: the vehicle is cut and knows it, the port may be closed."""
        landed = self._shutdown and self.arbiter.state not in FLYING and not self.undecided
        return landed and (self._low_frames >= THROTTLE_LOW_FRAMES or not self.port.is_open)

    def _due_s(self) -> float:
        if not self.port.is_open:
            return math.inf
        interval_s = self.protocol.minimum_interval_s if self._pending else self.protocol.keepalive_s
        return self._attempt_s + interval_s

    def _write(self, now_s: float) -> Write:
        output = self.output
        pulses, arming = channels_of(self._calibration, output, self._arming, now_s)
        disarmed = output.state is State.DISARMED
        if disarmed and now_s < self._shown_until_s:
            pulses = self._shown
        flags = FrameFlags(
            bind=disarmed and self._binding.active,
            range_check=disarmed and self._range_check and not self._binding.active,
            kill=output.state is State.KILLED,
            low_power=self._low_power,
        )
        frame = self.protocol.encode(pulses, flags, disarmed=disarmed)
        outcome = self.port.write_frame(frame, now_s)
        self._attempt_s = now_s
        self._pending = outcome is not WriteOutcome.WRITTEN
        if outcome is WriteOutcome.WRITTEN:
            self._written_u, self._written_s = output.u, now_s
            self._arming = arming
            self.protocol.frame_written(now_s)
            self._journal.note_change("reason", self.vehicle, now_s, self.arbiter.reason)
            self._journal.note("written", self.vehicle, now_s)
        if self._shutdown and output.state not in FLYING and outcome is WriteOutcome.WRITTEN:
            self._low_frames += 1
            last = self._low_frames == FAREWELL_FRAME and output.state is not State.KILLED
            if last and (frame := self.protocol.farewell()):
                self.port.write_frame(frame, now_s)
        return Write(now_s, outcome, output, pulses)

    @property
    def _too_late_s(self) -> float:
        """From when on a flight is over because nothing was written [s]."""
        return self._written_s + self.arbiter.limits.take_over_s

    def _open_link(self, now_s: float) -> None:
        """Go on with a module that was ready in flight, else begin anew."""
        self._opened_s = -math.inf if self._ready else now_s
        open_link = self.protocol.link_resumed if self._ready else self.protocol.link_opened
        open_link(now_s)

    def _flight_over(self, now_s: float) -> str | None:
        """Why a flight whose port has returned ends, as that of an earlier process is refused, if it does."""
        track = self.arbiter.pose_monitor.own_track
        problem = take_over_problem(self._applied(), track, self.arbiter.limits, now_s)
        self._ready = self._ready and problem is None
        if problem is None:
            self.arbiter.counters["flights continued after the port was away"] += 1
            self._returned_s = now_s
        return problem

    @property
    def _on_floor(self) -> bool:
        return seen_on_floor(self.arbiter.pose_monitor.own_track, self.arbiter.limits)

    def _judge_link(self, now_s: float, problem: str | None = None) -> None:
        """Judge the way to the vehicle, lost with a problem; a flight goes on with its port briefly away."""
        module = self.protocol.status(now_s)
        self._binding.follow(module, now_s)
        flying = self.arbiter.state in FLYING
        voltage_v = self.protocol.voltage_v(now_s)
        self.battery.observe(voltage_v, now_s, there=module.ready, flying=flying, u=self.output.u)
        if not flying:
            self._returned_s = -math.inf
        if not self.port.is_open and not (flying and now_s < self._too_late_s):
            problem = self.port.problem
        if self.arbiter.state is State.ARMED and now_s < self._returned_s + REPOWERED_S and self._on_floor:
            problem = "it may stand on the floor"
        link = self._link(module, now_s) if problem is None else LinkState.LOST
        self._ready = link is LinkState.READY
        if link is LinkState.UP and not self.busy(now_s):
            problem = self._text(module, now_s)
        self._journal.note_change("link", self.vehicle, now_s, link.value, problem)
        self.arbiter.link(link, problem)

    def _text(self, module: ModuleStatus, now_s: float) -> str:
        """State of the module, or the problem of its port, for people."""
        if self.undecided:
            return "waiting for the own pose"
        if not (self.port.is_open and module.ready):
            return self.port.problem or module.text
        if self._searched(now_s):
            return "waiting until the receiver has found the radio"
        weak = self.battery.problem(flying=self.arbiter.state in FLYING)
        return weak or self.port.overload or module.text
