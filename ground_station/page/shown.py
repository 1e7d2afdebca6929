"""What a page shows of a fleet, from the states of its vehicles at one time after another."""

from collections.abc import Sequence
from typing import Final, Protocol

from rcopterx.bus import channels
from rcopterx.ground_station.events import Timeline
from rcopterx.ground_station.page.alarms import AlarmBoard, causes_of
from rcopterx.ground_station.page.history import SAMPLE_S, sample_of
from rcopterx.ground_station.page.sentences import Words, fleet_sentence, is_down
from rcopterx.ground_station.page.view import Shown, events_shown, fleet_shown, motion_of, row_of
from rcopterx.ground_station.scripting.reader import Reader
from rcopterx.ground_station.scripting.state import VehicleState

TEXT_S: Final = 0.25


class Screen(Protocol):
    """Where a page is shown: the browsers of a running fleet (`Feed`), or a file."""

    def put(self, part: str, content: object) -> None:
        """Replace a part, see `rcopterx.ground_station.page.feed.PARTS`."""

    def add_sample(self, now_s: float, values: Sequence[Sequence[float | None]]) -> None:
        """Add samples of all vehicles, in the order of the fleet."""


class FleetShown:
    """A fleet on a screen, running or recorded.

    `down` is said of a fleet that is down; texts change once in `text_s` of the fleet's time; `steers` if
    the page has controls.
    """

    def __init__(
        self, fleet: Reader, screen: Screen, down: Words, text_s: float = TEXT_S, steers: bool = False
    ) -> None:
        self._fleet, self._screen, self._down, self._text_s = fleet, screen, down, text_s
        self._applied = fleet.source.subscribe_all(channels.APPLIED)
        fleet.watch_latency()
        fleet.watch_motion()
        self._timeline, self._alarms = Timeline(), AlarmBoard()
        self._next_text_s = self._next_sample_s = 0.0
        self._took_off_s: float | None = None
        self.down_since_s: float | None = None
        screen.put("fleet", fleet_shown(fleet.file, steers))

    def update(self, now_s: float) -> None:
        """Show the present state; `now_s` is the time of the fleet."""
        states = {name: self._fleet.state_of(name) for name in self._fleet.file.vehicles}
        self._timeline.compare(now_s, states)
        moving = states | {name: self._fleet.state_of(name) for name in self._fleet.file.subjects}
        self._screen.put("motion", {name: motion_of(state, moving) for name, state in moving.items()})
        if now_s >= self._next_sample_s:
            self._next_sample_s = now_s + 0.9 * SAMPLE_S
            newest = {name: inbox.latest() for name, inbox in self._applied.inboxes.items()}
            sticks = {name: received.message.input for name, received in newest.items() if received}
            samples = [sample_of(state, sticks.get(name)) for name, state in states.items()]
            self._screen.add_sample(now_s, samples)
        if now_s >= self._next_text_s:
            self._next_text_s = now_s + self._text_s
            self._screen.put("texts", self._texts(now_s, list(states.values())))

    def _texts(self, now_s: float, states: list[VehicleState]) -> Shown:
        """What is written on the page, by names that its scripts read."""
        down, airborne = is_down(states), any(state.airborne for state in states)
        self.down_since_s = (self.down_since_s or now_s) if down else None
        self._took_off_s = (self._took_off_s or now_s) if airborne else None
        problems = [] if airborne or down else self._fleet.problems()
        sentence = self._down if down else fleet_sentence(states, problems)
        shown = Shown(time_s=now_s, down=down, zones=self._fleet.zones.zones) | self._more(sentence)
        if down:
            return shown
        causes = [cause for state in states for cause in causes_of(state)]
        return shown | {
            "killed": any(state.transmitter_state == "killed" for state in states),
            "took_off_s": self._took_off_s,
            "recording": ", ".join(sorted({status.state for status in self._fleet.recorders().values()})),
            "problems": problems,
            "notes": self._fleet.notes(),
            "alarms": self._alarms.update(now_s, causes),
            "rows": {state.name: row_of(state) for state in states},
            "events": events_shown(self._timeline.lines),
        }

    def _more(self, sentence: Words) -> Shown:
        """Sentence about the fleet, and what only pages of running fleets show."""
        return {"sentence": sentence}
