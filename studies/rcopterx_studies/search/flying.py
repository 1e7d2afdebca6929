"""Flies a drawn flight in this process, and returns which promises it breaks."""

import hashlib
import random
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Final, NamedTuple

from rcopterx.bus.session import RawMessage
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS
from rcopterx_studies.faults.flight_promises import NEEDED, broken_promises
from rcopterx_studies.faults.promise import OFF
from rcopterx_studies.replay.digest import DIGESTED
from rcopterx_studies.search import flights
from rcopterx_studies.search.flights import Flight, Happening, request_of
from rcopterx_studies.search.memory_bus import Travel
from rcopterx_studies.search.one_process import OneProcess, in_one_process
from rcopterx_studies.search.watch import Finding, Watch

DOWN_S: Final = 30.0  # by then everything that was requested to land stands on the floor


class Flown(NamedTuple):
    """What a flight has shown."""

    findings: list[Finding]
    digest: str  # equal for flights with the same bits
    visited: dict[str, int]  # states and transitions of arbiters and pilots
    flown_s: float


def fly(flight: Flight) -> Flown:
    """Fly a flight."""
    kept: list[RawMessage] = []
    digest = hashlib.sha256()
    digested, needed = ({channel.topic for channel in each} for each in (DIGESTED, NEEDED))

    def store(message: RawMessage) -> None:
        if message.topic in digested:
            digest.update(f"{message.unit}/{message.topic} {message.number} ".encode() + message.payload)
        if message.topic in needed:
            kept.append(message)
        watch.receive(message)

    file = flight.file(_free_port())
    watch = Watch(flight, file.volume.min_m, file.volume.max_m)
    with in_one_process(file, store) as process:
        flier = _Flier(flight, watch, process)
        process.run(flier.fly)
    for failure in process.turns.failures:
        watch.find("exception", failure.at_s, f"{failure.process}: {failure.error!r}")
    for at_s, vehicle, promise in broken_promises(Recording(kept)):
        watch.find("frames", at_s, f"{vehicle}: {promise}")
    return Flown(watch.findings, digest.hexdigest()[:16], dict(watch.visited), flier.flown_s)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class _Flier:
    """The script of a flight."""

    def __init__(self, flight: Flight, watch: Watch, process: OneProcess) -> None:
        self._flight, self._watch, self._process = flight, watch, process
        self._chance = random.Random(flight.seed)
        self.flown_s = 0.0

    def fly(self, fleet: Fleet) -> None:
        """Let everything happen, then land, until a promise is broken."""
        with suppress(*FLIGHT_ERRORS):
            fleet.wait_ready()
        clock, watch = fleet.session.clock, self._watch
        began_s = clock()
        for happening in self._flight.happenings:
            self._wait(fleet, began_s + happening.at_s)
            if watch.findings:
                break
            watch.note(happening, clock())
            try:
                self._happen(fleet, happening)
            except FLIGHT_ERRORS:
                pass  # a refusal
            except Exception as error:  # noqa: BLE001 - a promise is broken
                watch.find("exception", clock(), f"{happening.verb} of {happening.unit}: {error!r}")
        self._wait(fleet, began_s + self._flight.seconds)
        if not watch.findings:
            self._process.turns.bus.travel = None
            watch.landing(clock())
            self._land(fleet)
        self.flown_s = clock() - began_s

    def _wait(self, fleet: Fleet, until_s: float) -> None:
        while not self._watch.findings and (left_s := until_s - fleet.session.clock()) > 0.0:
            fleet.wait(min(left_s, 0.1))

    def _happen(self, fleet: Fleet, happening: Happening) -> None:
        unit, fields, session = happening.unit, happening.fields, fleet.session
        participant = session.participant
        assert participant is not None
        match happening.verb:
            case flights.UP:
                fleet.arm(fields["names"])
                for name in fields["names"]:
                    fleet[name].take_off(fields["height_m"])
            case flights.PROMOTE:
                fleet.promote(unit)
            case flights.PAUSE:
                fleet.suspend()
            case flights.GO_ON:
                fleet.resume()
            case flights.END:
                participant.kill(unit)
            case flights.STOP:
                participant.stop(unit, fields["seconds"])
            case flights.IMPAIR:
                self._process.turns.bus.travel = impaired(self._chance, session.clock(), fields)
            case verb:
                if verb == "kill":
                    self._watch.killed(unit, session.clock())
                session.request(unit, request_of(happening))

    def _land(self, fleet: Fleet) -> None:
        """Land all vehicles; each has to stand with its motors off in time."""
        watch, clock = self._watch, fleet.session.clock
        give_up_s = clock() + DOWN_S
        while not watch.findings:
            with suppress(*FLIGHT_ERRORS):
                fleet.land()
            states = {name: fleet.state_of(name).transmitter_state for name in self._flight.vehicles}
            if set(states.values()) <= OFF:
                return
            if clock() > give_up_s:
                watch.find("landed", clock(), f"not down {DOWN_S:g} s after the request to land: {states}")
            fleet.wait(0.5)


def impaired(chance: random.Random, now_s: float, fields: Mapping[str, float]) -> Travel:
    """Return how messages travel for `seconds`: shares `lost` and `doubled`, and up to `late_s` late."""
    lost, doubled, late_s = (fields.get(name, 0.0) for name in ("lost", "doubled", "late_s"))
    ends_s = now_s + fields["seconds"]

    def travel(sent_s: float) -> tuple[float, ...]:
        if sent_s > ends_s:
            return (sent_s,)
        if chance.random() < lost:
            return ()
        arrives_s = sent_s + chance.uniform(0.0, late_s)
        return (arrives_s, arrives_s) if chance.random() < doubled else (arrives_s,)

    return travel
