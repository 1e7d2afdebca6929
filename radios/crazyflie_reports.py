"""What the firmware of a Crazyflie reports: state, protocol, console (crazyflie-firmware, supervisor.c)."""

import math

from rcopterx.radios.crtp import CONSOLE, PLATFORM, VERSION_CHANNEL, Packet, SupervisorState

NEEDED_PROTOCOL = 12  # of firmware from 2026.04 on; older ones report no state
SILENT_S = 1.0
REARMING_S = 0.5  # for so long a vehicle that stands may be neither armed nor ready to be armed
FALL_BACKS = 2  # so many armings that the firmware ended by itself before it could fly are a refusal
COMPLAINT = "[FAIL]"  # end of lines of the console that say why the firmware does not arm
LONGEST_LINE = 120  # of which the end is kept


class FirmwareReports:
    """The newest reports since the link was opened.

    `state`: None before the first one. `complaint`: last line of the console that says why the firmware does
    not arm; empty before the first one, and once it can fly. `fall_backs`: armings that it ended before that.
    """

    def __init__(self) -> None:
        self.state: SupervisorState | None = None
        self.complaint = ""
        self.fall_backs = 0
        self._protocol: int | None = None
        self._line = ""
        self._answered_s = self._usable_s = self._flyable_s = -math.inf

    def resume(self, now_s: float) -> None:
        """Assume that the vehicle flies, as if it had just reported it."""
        self._answered_s = self._usable_s = self._flyable_s = now_s
        self.state = SupervisorState(armed=True, can_fly=True)

    def take(self, packet: Packet, now_s: float) -> bool:
        """Keep a report; return whether it is a state. Raises `FrameDecodeError` for a malformed one."""
        if packet.port == CONSOLE:
            self._print(packet.data.decode("ascii", "replace"))
        elif (packet.port, packet.channel) == (PLATFORM, VERSION_CHANNEL) and len(packet.data) == 2:
            self._protocol = packet.data[1]
        elif (state := SupervisorState.of(packet)) is not None:
            before, self.state, self._answered_s = self.state, state, now_s
            spun_up = before is not None and before.armed and not before.can_fly
            self.fall_backs = 0 if state.can_fly else self.fall_backs + (spun_up and not state.armed)
            if state.armed or state.can_be_armed:
                self._usable_s = now_s
            if state.can_fly:
                self._flyable_s, self.complaint = now_s, ""
            return True
        return False

    def _print(self, text: str) -> None:
        ended = (self._line + text.replace("\0", "")).split("\n")
        *lines, self._line = (line[-LONGEST_LINE:] for line in ended)
        self.complaint = next((line for line in reversed(lines) if line.endswith(COMPLAINT)), self.complaint)

    def problem(self, now_s: float, *, armed: bool, thrusts: bool) -> str | None:
        """Why the firmware would not fly; None if it would. `armed`, `thrusts`: what the frames ask for."""
        state = self.state
        if state is None:
            if self._protocol is not None and self._protocol < NEEDED_PROTOCOL:
                return f"firmware too old: protocol {self._protocol}, {NEEDED_PROTOCOL} is needed (2026.04)"
            return "no answer from the vehicle yet; check its power, channel, data rate and address"
        if now_s - self._answered_s > SILENT_S:
            return f"vehicle gone: silent for {now_s - self._answered_s:.1f} s"
        if state.locked:
            return "the vehicle is locked after a stop: reset it, or switch it off and on"
        if state.tumbled:
            return "the vehicle lies on its side: put it upright"
        if state.crashed:
            return "the vehicle has crashed: check it and reset it"
        if armed and (self.fall_backs >= FALL_BACKS or (thrusts and now_s - self._flyable_s > REARMING_S)):
            return f"the firmware did not arm: {self.complaint or 'its motors have not spun up'}"
        return None if armed or now_s - self._usable_s <= REARMING_S else "the vehicle checks itself"
