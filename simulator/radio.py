"""Radio module and receiver behind a pseudo-terminal: the end of the line a transmitter gateway writes to."""

import fcntl
import os
import pty
import termios
import tty
from collections import Counter
from pathlib import Path

from rcopterx.simulator.radio_module import RadioEnd, RadioModule, Reception
from rcopterx.simulator.radio_receiver import Receiver

READ_SIZE = 4096
SILENT_S = 0.07


class RadioLink(Reception):
    """A module and the receiver that receives its packets, without any port."""

    def __init__(self, module: RadioModule, receiver: Receiver) -> None:
        super().__init__(module.frames)
        self.module = module
        self.receiver = receiver

    def power_cycle(self, now_s: float) -> None:
        """See `RadioModule`."""
        self.powered = True
        self.module.power_cycle(now_s)

    def advance(self, now_s: float) -> bytes:
        """Advance the time; return the answers of the module."""
        if not self.powered:
            self.note_output(now_s)
            return b""
        answers = self.module.advance(now_s)
        for packet in self.module.take_packets():
            self.receiver.receive(packet)
            self.note_output(packet.time_s)
        self.note_output(now_s)
        return answers

    def note_output(self, time_s: float) -> None:
        """Note the output of the receiver; it has one without a module, too."""
        self.note_pulses(time_s, self.receiver.pulses_us(time_s))


class RadioPty(RadioEnd):
    """A `RadioLink` on a pseudo-terminal with a fixed name, a symbolic link.

    Call `receive` whenever `fileno` is readable and `advance` often enough for the module to answer.
    A link left over by a killed process is replaced; `FileExistsError` if `path` is no symbolic link.
    """

    def __init__(self, path: str | Path, link: RadioLink) -> None:
        super().__init__(link)
        self.path = Path(path)
        self.link = link
        self.counters: Counter[str] = Counter()
        self._master = self._slave = -1
        self._received_s: float | None = None
        self._fed_s = 0.0
        self._exclusive_cleared = False
        self._open()

    def _open(self) -> None:
        if self.path.exists() and not self.path.is_symlink():
            raise FileExistsError(f"{self.path} exists and is not a symbolic link; not replaced")
        self._master, self._slave = pty.openpty()
        # Raw before anybody opens it: otherwise the line discipline echoes the module's answers to itself.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(os.ttyname(self._slave))
        fresh.replace(self.path)

    def fileno(self) -> int:
        """Descriptor to wait for written bytes on, -1 while unplugged."""
        return self._master

    def receive(self, now_s: float) -> None:
        """Read the written bytes; `advance` passes them to the module."""
        if self.is_open:
            self._read(now_s)
            self._received_s = now_s

    def advance(self, now_s: float) -> None:
        """Advance the time and write the answers; bytes written until now must have been received."""
        self._received_s = now_s
        if self.is_open and not self._exclusive_cleared and now_s > self._fed_s + SILENT_S:
            # A pseudo-terminal, unlike an adapter, keeps the exclusive mark of a writer that is gone.
            fcntl.ioctl(self._slave, termios.TIOCNXCL)
            self._exclusive_cleared = True
        answers = self.link.advance(now_s)
        if answers and self.is_open:
            try:
                os.write(self._master, answers)
            except BlockingIOError:
                self.counters["unread answers"] += 1

    def _read(self, now_s: float) -> None:
        try:
            data = os.read(self._master, READ_SIZE)
        except BlockingIOError:
            return
        self._fed_s, self._exclusive_cleared = now_s, False
        if not self.link.powered:
            return
        for start_s, frame in self._separated(data, now_s):
            self.link.module.feed(frame, start_s)

    def _separated(self, data: bytes, now_s: float) -> list[tuple[float, bytes]]:
        """Restore the pauses of frames that piled up between two reads."""
        # A pseudo-terminal does not report when bytes were written. Bytes of one read count as back to back,
        # unless the last read is so long ago that whole frames can have arrived one after the other.
        length = self.link.module.frame_length
        if len(data) < 2 * length:
            return [(now_s, data)]
        count, rest = divmod(len(data), length)
        waited_s = now_s - self._received_s if self._received_s is not None else 0.0
        spacing_s = waited_s / count
        if rest or spacing_s < self.link.module.shortest_spacing_s:
            return [(now_s, data)]
        self.counters["late services"] += 1
        return [
            (now_s - (count - 1 - i) * spacing_s, data[i * length : (i + 1) * length]) for i in range(count)
        ]

    def unplug(self, *, powered: bool = False) -> None:
        """Pull the cable: the device vanishes for its users; `powered` if the module has power of its own."""
        if not self.is_open:
            return
        if not powered:
            self.link.switch_off()
        target = os.ttyname(self._slave)
        os.close(self._master)
        os.close(self._slave)
        self._master = self._slave = -1
        if self.path.is_symlink() and str(self.path.readlink()) == target:
            self.path.unlink()

    def replug(self, now_s: float) -> None:
        """Plug the cable in again; a module that was without power boots."""
        if not self.is_open:
            self._open()
            self.switch_on(now_s)
