"""A recorded flight as its page showed it: what the page's scripts received, at one time after another."""

from collections.abc import Iterable, Sequence
from typing import Any, Final, TypeVar

from msgspec import Raw
from msgspec.json import encode

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.message import Message
from rcopterx.bus.session import RawMessage
from rcopterx.bus.subscription import Inbox, Units
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.page.history import SAMPLE_S
from rcopterx.ground_station.page.sentences import Words
from rcopterx.ground_station.page.shown import FleetShown
from rcopterx.ground_station.scripting.reader import Reader

M = TypeVar("M", bound=Message)


MAX_STATES: Final = 7500  # of all vehicles at all steps, about a megabyte: a longer flight has longer steps
SILENT: Final = Words("no process of the fleet reports", "off")


class LoggedBus:
    """Messages of a recorded flight in order of arrival, up to a time [s]; a `bus.subscription.Source`.
    Times count from `started_s` on the clock of the recording.
    """

    def __init__(self, records: Iterable[RawMessage], started_s: float) -> None:
        self._records, self._started_s = iter(records), started_s
        self._next = next(self._records, None)
        self._units: dict[str, list[Units[Any]]] = {}
        self._now_s = 0.0

    def clock(self) -> float:
        """Return the time up to which messages have arrived."""
        return self._now_s

    def subscribe(self, channel: Channel[M], unit: str) -> Inbox[M]:
        """Receive a channel of one unit."""
        inbox = self.subscribe_all(channel).inboxes[unit] = Inbox(channel, unit=unit)
        return inbox

    def subscribe_all(
        self,
        channel: Channel[M],
        depth: int = 1,
        *,
        waking: bool = True,  # noqa: ARG002 - no loop waits
    ) -> Units[M]:
        """Receive a channel of every unit."""
        units = Units(channel, depth)
        self._units.setdefault(channel.topic, []).append(units)
        return units

    def advance(self, now_s: float) -> bool:
        """Let messages arrive up to a time; return whether there are later ones."""
        self._now_s = now_s
        while self._next is not None and (arrived_s := self._next.arrived_s - self._started_s) <= now_s:
            for units in self._units.get(self._next.topic, ()):
                if (inbox := units.inbox(self._next.unit)) is not None:
                    inbox.store(self._next.payload, arrived_s)
            self._next = next(self._records, None)
        return self._next is not None


class Film:
    """A screen that keeps everything: one motion and one sample a step, and of texts what changed."""

    def __init__(self) -> None:
        self._fleet: object = None
        self._samples: list[Raw] = []
        self._motion: list[Raw] = []
        self._texts: list[tuple[int, Raw]] = []  # with the step from which they are shown
        self._newest: dict[str, Raw] = {}

    def put(self, part: str, content: object) -> None:
        """Add a step, texts of the present step, or the fleet."""
        if part == "motion":
            self._motion.append(Raw(encode(content)))
        elif part == "texts":
            assert isinstance(content, dict)
            self._add_texts({name: Raw(encode(value)) for name, value in content.items()})
        else:
            self._fleet = content

    def _add_texts(self, texts: dict[str, Raw]) -> None:
        wanted = dict.fromkeys(self._newest, Raw(b"null")) | texts
        changed = {name: value for name, value in wanted.items() if self._newest.get(name) != value}
        self._newest = wanted
        self._texts.append((len(self._motion) - 1, Raw(encode(changed))))

    def add_sample(self, now_s: float, values: Sequence[Sequence[float | None]]) -> None:
        """Add samples of all vehicles."""
        self._samples.append(Raw(encode([round(now_s, 2), *values])))

    def content(self, name: str) -> dict[str, object]:
        """What the scripts of the page play."""
        return {
            "name": name, "fleet": self._fleet, "samples": self._samples, "motion": self._motion,
            "texts": self._texts,
        }  # fmt: skip


def filmed(name: str, fleet: FleetFile, records: Sequence[RawMessage], started_s: float) -> dict[str, object]:
    """Play messages in order of arrival, and return the film; `started_s` is its beginning on their clock."""
    film, bus = Film(), LoggedBus(records, started_s)
    shown = FleetShown(Reader(fleet, next(iter(fleet.hosts)), bus), film, SILENT)
    seconds = records[-1].arrived_s - started_s
    step_s = max(SAMPLE_S, seconds * len(fleet.vehicles) / MAX_STATES)
    goes_on, status = True, channels.AGENT_STATUS.topic
    first = (one.arrived_s for one in records if one.topic == status and one.unit in fleet.vehicles)
    now_s = max(0.0, next(first, started_s) - started_s)  # before there is nothing to see
    while goes_on:
        goes_on = bus.advance(now_s)
        shown.update(now_s)
        now_s += step_s
    return film.content(name)
