"""The end of a gateway's line: what the simulated laboratory needs of any emulated radio."""

from abc import ABC, abstractmethod

from rcopterx.simulator.plant import Plant
from rcopterx.simulator.radio_module import Reception


class RadioEnd(ABC):
    """A radio and the receiver of its vehicle.

    Call `receive` whenever `fileno` is readable, and `live` often enough for answers and time limits.
    """

    def __init__(self, reception: Reception) -> None:
        self.reception = reception

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

    def sense(self, plant: Plant, now_s: float) -> None:  # noqa: B027 - few vehicles report it
        """Measure the pose of the vehicle, whose body is `plant`."""

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

    def close(self) -> None:
        """Remove the port."""
        self.unplug()
