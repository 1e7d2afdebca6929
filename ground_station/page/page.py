"""The page: serves its files, and keeps browsers up to date."""

import re
import time
from collections import deque
from collections.abc import Callable
from contextlib import closing
from functools import partial
from html import escape
from itertools import count
from pathlib import Path
from typing import Final

from rcopterx.bus import channels
from rcopterx.bus.session import BusUnreachableError
from rcopterx.ground_station.events import Timeline
from rcopterx.ground_station.page.alarms import AlarmBoard, causes_of
from rcopterx.ground_station.page.feed import Feed
from rcopterx.ground_station.page.guard import PageServer
from rcopterx.ground_station.page.history import SAMPLE_S, sample_of
from rcopterx.ground_station.page.sentences import Words, down_sentence, fleet_sentence, is_down
from rcopterx.ground_station.page.steering import PageSteering, decode
from rcopterx.ground_station.page.view import events_shown, fleet_shown, motion_of, row_of
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.joining import WrongFleetError
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.scripting.waiting import NotReachedError, Stop

WEB: Final = Path(__file__).parent / "web"
UPDATE_S: Final = 0.05
TEXT_S: Final = 0.25
COMES_UP_S: Final = 15.0  # how long the page waits for a fleet that is being started
GONE_S: Final = 3.0  # how long a fleet is shown as down before the page tries to join it again
NOTICES_KEPT: Final = 5
_CONTROLS: Final = re.compile("<!--controls-->.*?<!--/controls-->", re.DOTALL)  # parts of the document


class PageFrame:
    """The served page, which waits for a fleet until `FleetPage` fills it; `steers` if not watching."""

    def __init__(self, port: int, name: str, key: str, steers: bool = True) -> None:
        self.name, self.steers = name, steers
        self.feed = Feed()
        self.show(Words("waiting for the fleet to come up", "off"))
        self._files = {
            path.relative_to(WEB).as_posix(): path.read_bytes()
            for path in WEB.rglob("*")
            if path.suffix in (".css", ".js")
        }
        document = (WEB / "index.html").read_text("utf-8")
        self._document = document if steers else _CONTROLS.sub("", document)
        self.server = PageServer(port, key, self.file, self.feed.stream)

    def show(self, sentence: Words) -> None:
        """Show nothing but a sentence, while there is no fleet."""
        self.sentence = sentence
        self.feed.put("texts", {"time_s": 0.0, "sentence": sentence, "down": True})

    def file(self, name: str) -> bytes | None:
        """Content of a file of the page, None if there is none; the document has the present sentence."""
        if name:
            return self._files.get(name)
        parts = {"name": self.name, "sentence": self.sentence.text, "level": self.sentence.level}
        document = self._document
        for part, text in parts.items():
            document = document.replace(f"{{{part}}}", escape(text))
        return document.encode()


def keep_showing(
    frame: PageFrame, join: Callable[[], Fleet], stop: Stop, patience_s: float = COMES_UP_S
) -> None:
    """Show a fleet whenever `join` finds it, until a stop; say after `patience_s` that it is down."""
    down_s = time.monotonic() + patience_s
    while not stop.is_set():
        try:
            fleet = join()
        except BusUnreachableError:
            if time.monotonic() > down_s:
                frame.show(down_sentence(frame.name))
        except (WrongFleetError, NotReachedError) as error:
            frame.show(Words(str(error), "amber"))
            stop.wait(UPDATE_S)
        else:
            down_s = 0.0
            with closing(fleet):
                FleetPage(fleet, frame).run(stop)


class FleetPage:
    """A running fleet in the browser."""

    def __init__(self, fleet: Fleet, frame: PageFrame) -> None:
        self._fleet, self._frame = fleet, frame
        self._applied = fleet.session.subscribe_all(channels.APPLIED)
        fleet.watch_latency()
        fleet.watch_motion()
        self._timeline, self._alarms = Timeline(), AlarmBoard()
        self._notices: deque[dict[str, object]] = deque(maxlen=NOTICES_KEPT)
        self._numbers = count(1)
        self._next_text_s = self._next_sample_s = 0.0
        self._took_off_s: float | None = None
        self.down_since_s: float | None = None
        self.steering = PageSteering(fleet, self.notify) if frame.steers else None
        frame.feed.put("fleet", fleet_shown(fleet.file, frame.steers))
        if self.steering is not None:
            frame.server.perform = partial(decode, steering=self.steering, vehicles=fleet.file.vehicles)

    def run(self, stop: Stop) -> None:
        """Update the page until a stop is requested, or no process of the fleet has reported for a while."""
        next_s, clock = time.monotonic(), self._fleet.session.clock
        while not stop.is_set() and (self.down_since_s is None or clock() - self.down_since_s < GONE_S):
            self.update(clock())
            # Late updates are not caught up.
            next_s = max(next_s + UPDATE_S, time.monotonic())
            time.sleep(max(0.0, next_s - time.monotonic()))
        self._frame.server.perform = None

    def notify(self, text: str, refused: bool) -> None:
        """Show an answer in every browser."""
        notice = {"number": next(self._numbers), "time_s": self._fleet.session.clock()}
        self._notices.append(notice | {"text": text, "refused": refused})

    def update(self, now_s: float) -> None:
        """Show the present state; `now_s` is the time of the fleet."""
        states = {vehicle.name: vehicle.state for vehicle in self._fleet}
        feed = self._frame.feed
        self._timeline.compare(now_s, states)
        feed.put("motion", {name: motion_of(state, states) for name, state in states.items()})
        if now_s >= self._next_sample_s:
            self._next_sample_s = now_s + 0.9 * SAMPLE_S
            newest = {name: inbox.latest() for name, inbox in self._applied.inboxes.items()}
            sticks = {name: received.message.input for name, received in newest.items() if received}
            feed.add_sample(now_s, [sample_of(state, sticks.get(name)) for name, state in states.items()])
        if now_s >= self._next_text_s:
            self._next_text_s = now_s + self._fleet.file.clock.speed * TEXT_S
            feed.put("texts", self._texts(now_s, list(states.values())))

    def _texts(self, now_s: float, states: list[VehicleState]) -> dict[str, object]:
        """What is written on the page, by names that its scripts read."""
        down, airborne = is_down(states), any(state.airborne for state in states)
        self.down_since_s = (self.down_since_s or now_s) if down else None
        self._took_off_s = (self._took_off_s or now_s) if airborne else None
        problems = [] if airborne or down else self._fleet.problems()
        frame = self._frame
        frame.sentence = down_sentence(frame.name) if down else fleet_sentence(states, problems)
        shown = {"time_s": now_s, "sentence": frame.sentence, "down": down, "notices": list(self._notices)}
        if down:
            return shown
        causes = [cause for state in states for cause in causes_of(state)]
        weights = {} if self.steering is None else self.steering.weights
        return shown | {
            "killed": any(state.transmitter_state == "killed" for state in states),
            "took_off_s": self._took_off_s,
            "recording": ", ".join(sorted({status.state for status in self._fleet.recorders().values()})),
            "problems": problems,
            "notes": self._fleet.notes(),
            "alarms": self._alarms.update(now_s, causes),
            "rows": {state.name: row_of(state) for state in states},
            "powers": {name: one.powers for name, one in weights.items()},
            "events": events_shown(self._timeline.lines),
        }
