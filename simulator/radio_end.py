"""The end of a gateway's line: what the simulated laboratory needs of any emulated radio."""

from abc import ABC, abstractmethod

from rcopterx.simulator.radio_module import SerialFrame


class RadioEnd(ABC):
    """A radio and the receiver of its vehicle.

    Call `receive` whenever `fileno` is readable, and `live` often enough for answers and time limits.
    """

    @property
    @abstractmethod
    def is_open(self) -> bool:
        """False while unplugged or closed."""

    @abstractmethod
    def fileno(self) -> int:
        """Descriptor to wait for written bytes on, -1 while unplugged."""

    @abstractmethod
    def receive(self, now_s: float) -> None:
        """Read what was written."""

    @abstractmethod
    def live(self, now_s: float) -> None:
        """Advance the time."""

    @abstractmethod
    def take_outputs(self) -> list[tuple[float, tuple[float, ...]]]:
        """Return and forget when the vehicle has got other pulse widths, and which [us]."""

    @abstractmethod
    def take_frames(self) -> list[SerialFrame]:
        """Return and forget the frames that were accepted."""

    @abstractmethod
    def unplug(self, *, powered: bool = False) -> None:
        """Pull the cable: the port vanishes for its users; `powered` if the radio has power of its own."""

    @abstractmethod
    def replug(self, now_s: float) -> None:
        """Plug the cable in again; a radio that was without power boots."""

    @abstractmethod
    def switch_off(self) -> None:
        """Take the power away; the port stays."""

    @abstractmethod
    def switch_on(self, now_s: float) -> None:
        """Give the power back; it boots."""

    @abstractmethod
    def close(self) -> None:
        """Remove the port."""
