"""The flight of `rcopterx demo`: the paper's set points in a loop."""

import math
from collections.abc import Callable, Sequence
from itertools import count

from rich.table import Table
from rich.text import Text

from rcopterx.ground_station.acceptance.paper_sequence import fly_paper_sequence, leader_of
from rcopterx.ground_station.report.figures import SETTLED_S, FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler, Recording
from rcopterx.ground_station.report.statistics import rms_and_max
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.observer import STARTED_S
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS
from rcopterx.ground_station.scripting.waiting import Stop, StoppedError, stopped_by
from rcopterx.vehicles.phases import Phase

TURNS_PER_SEQUENCE = 3 * math.pi
RECORDS_KEPT = 40_000
KNOWN_S = 1.0  # by then a set point is in the leader's status, which is published at 5 Hz
POLL_S = 0.2
GO_ON = (
    "reset what is killed and take off again on the page, or by rcopterx reset and rcopterx takeoff; "
    "Ctrl-C ends"
)
HEADINGS = (
    "vehicle", "task", "error [mm]\nrms / max", "missed\nperiods", "solver [ms]\np50 / p99", "fallbacks",
)  # fmt: skip
CAPTION = (
    f"Error: of followers from their place in the formation; of leaders from their\n"
    f"set point, once it has not moved for {SETTLED_S:.0f} s."
)


class Demonstration:
    """Flies a running fleet until `stop` is set."""

    def __init__(self, fleet: Fleet, stop: Stop, say: Callable[[str], object]) -> None:
        self._fleet, self._clock = fleet, fleet.session.clock
        self._stop = stop
        self._say = say
        self._leader = leader_of(fleet)
        self._recorder = FlightSampler(fleet.session, RECORDS_KEPT)
        self._recording = Recording(())
        self._end_s = math.inf
        self._flown_s = 0.0
        self.problem: str | None = None  # what ended it early

    def fly(self, seconds: float | None) -> None:
        """Take off and fly, for a time or without end; without end it stays up whatever ends the flight."""
        try:
            self._take_off_and_fly(seconds)
        except StoppedError:
            return
        except FLIGHT_ERRORS as error:
            if seconds is not None:
                self.problem = str(error)
                return
            self._say(f"{error}; {GO_ON}")
            while not self._stop.wait(POLL_S):
                pass

    def _take_off_and_fly(self, seconds: float | None) -> None:
        with stopped_by(self._stop):
            self._fleet.wait_ready(timeout_s=STARTED_S)
            self._fleet.take_off()
        started_s = self._clock()
        self._end_s = math.inf if seconds is None else started_s + seconds
        self._recorder.start()
        try:
            for turns in count():
                fly_paper_sequence(
                    self._fleet, lambda _: None, self._wait_or_stop, turns * TURNS_PER_SEQUENCE
                )
        finally:
            self._flown_s = self._clock() - started_s
            self._recording = self._recorder.stop()

    def _wait_or_stop(self, seconds: float) -> None:
        """Wait between two set points; once another program steers the leader, wait for the end."""
        self._pause(min(seconds, KNOWN_S))
        given = self._task()
        until_s = self._clock() + seconds - KNOWN_S
        while (left_s := until_s - self._clock()) > 0.0:
            self._pause(min(POLL_S, left_s))
            now = self._task()
            if given is not None and now is not None and now != given:
                self._say(f"{self._leader} is steered by another program now; Ctrl-C lands")
                while True:
                    self._pause(POLL_S)

    def _pause(self, seconds: float) -> None:
        left_s = self._end_s - self._clock()
        wait_s = self._fleet.file.clock.real_s(max(0.0, min(seconds, left_s)))
        if self._stop.wait(wait_s) or self._clock() >= self._end_s:
            raise StoppedError

    def _task(self) -> object:
        """Present task of the leader; None while it is unknown, as when the arbiter lands it."""
        state = self._fleet[self._leader].state
        agent = state.agent
        if agent is None or agent.phase not in (Phase.FLYING, Phase.LANDING):
            return None
        return agent.phase, agent.set_point, state.assigned, agent.path_left_s > 0.0

    def summary(self) -> Table:
        """Figures of the flight, or of its last minute."""
        names = list(self._fleet.file.vehicles)
        return summary_table(FlightFigures(self._recording, names), names, self._flown_s)


def summary_table(figures: FlightFigures, names: Sequence[str], flown_s: float) -> Table:
    """Figures of every vehicle, in 80 columns."""
    table = Table(
        title=Text(f"flown for {flown_s:.0f} s"),
        title_justify="left",
        caption=Text(CAPTION),
        caption_justify="left",
        box=None,
        padding=(0, 2, 0, 0),
        pad_edge=False,
    )
    for heading in HEADINGS:
        table.add_column(Text(heading))
    for name in names:
        row, leaders = figures.vehicle(name), figures.followed(name)
        errors_mm = row["formation_error_mm"] or rms_and_max(figures.settled_error_m(name))
        solve = row["solve_ms"]
        table.add_row(
            name,
            f"follows {', '.join(leaders)}" if leaders else "leads",
            "-" if errors_mm is None else f"{errors_mm['rms']:.0f} / {errors_mm['max']:.0f}",
            f"{row['missed_ticks']} of {row['ticks']}",
            "-" if solve is None else f"{solve['p50']:.1f} / {solve['p99']:.1f}",
            ", ".join(f"{kind} {count}" for kind, count in row["fallbacks"].items()) or "none",
        )
    return table
