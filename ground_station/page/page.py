"""The page: serves its files, and keeps browsers up to date."""

import time
from collections import deque
from collections.abc import Callable
from contextlib import closing
from functools import partial
from itertools import count
from typing import Final

from rcopterx.bus.session import BusUnreachableError
from rcopterx.ground_station.page.document import document, web_files
from rcopterx.ground_station.page.feed import Feed
from rcopterx.ground_station.page.guard import PageServer
from rcopterx.ground_station.page.sentences import Words, down_sentence
from rcopterx.ground_station.page.shown import TEXT_S, FleetShown
from rcopterx.ground_station.page.steering import PageSteering, decode
from rcopterx.ground_station.page.view import Shown
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.joining import WrongFleetError
from rcopterx.ground_station.scripting.waiting import NotReachedError, Stop

UPDATE_S: Final = 0.05
COMES_UP_S: Final = 15.0  # how long the page waits for a fleet that is being started
GONE_S: Final = 3.0  # how long a fleet is shown as down before the page tries to join it again
NOTICES_KEPT: Final = 5


class PageFrame:
    """The served page, which waits for a fleet until `FleetPage` fills it; `steers` if not watching."""

    def __init__(self, port: int, name: str, key: str, steers: bool = True) -> None:
        self.name, self.steers = name, steers
        self.feed = Feed()
        self.show(Words("waiting for the fleet to come up", "off"))
        self.server = PageServer(port, key, self.file, self.feed.stream)

    def show(self, sentence: Words) -> None:
        """Show nothing but a sentence, while there is no fleet."""
        self.sentence = sentence
        self.feed.put("texts", {"time_s": 0.0, "sentence": sentence, "down": True})

    def file(self, name: str) -> bytes | None:
        """Content of a file of the page, None if there is none; the document has the present sentence."""
        if name:
            return web_files().get(name)
        return document(self.name, self.sentence, self.steers).encode()


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


class FleetPage(FleetShown):
    """A running fleet in the browser."""

    def __init__(self, fleet: Fleet, frame: PageFrame) -> None:
        self._session, self._frame = fleet.session, frame
        self._notices: deque[Shown] = deque(maxlen=NOTICES_KEPT)
        self._numbers = count(1)
        self.steering = PageSteering(fleet, self.notify) if frame.steers else None
        text_s = fleet.file.clock.speed * TEXT_S
        super().__init__(fleet, frame.feed, down_sentence(frame.name), text_s, frame.steers)
        if self.steering is not None:
            steering, (vehicles, leaders) = self.steering, (fleet.file.vehicles, fleet.file.tracked)
            frame.server.perform = partial(decode, steering=steering, vehicles=vehicles, leaders=leaders)

    def run(self, stop: Stop) -> None:
        """Update the page until a stop is requested, or no process of the fleet has reported for a while."""
        next_s, clock = time.monotonic(), self._session.clock
        while not stop.is_set() and (self.down_since_s is None or clock() - self.down_since_s < GONE_S):
            self.update(clock())
            # Late updates are not caught up.
            next_s = max(next_s + UPDATE_S, time.monotonic())
            time.sleep(max(0.0, next_s - time.monotonic()))
        self._frame.server.perform = None

    def notify(self, text: str, refused: bool) -> None:
        """Show an answer in every browser."""
        notice = {"number": next(self._numbers), "time_s": self._session.clock()}
        self._notices.append(notice | {"text": text, "refused": refused})

    def _more(self, sentence: Words) -> Shown:
        """Answers to requests and weights; the document begins with the present sentence, too."""
        self._frame.sentence = sentence
        weights = {} if self.steering is None else self.steering.weights
        powers = {name: one.powers for name, one in weights.items()}
        return super()._more(sentence) | {"notices": list(self._notices), "powers": powers}
