"""Flights that the search draws from a seed: a fleet, its weather, and what happens to it when."""

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import Struct

from rcopterx.bus.channels import SIMULATOR_UNIT
from rcopterx.bus.processes import TRACKER, TRANSMITTERS
from rcopterx.bus.requests import VERBS, Request
from rcopterx.deploy.processes.table import agent_process
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetFile

# What happens besides the requests of `rcopterx.bus.requests`.
END: Final = "end"  # a process is killed
STOP: Final = "stop"  # it takes no turns for `seconds`
IMPAIR: Final = "impair"  # for `seconds` messages are lost, doubled, or late by up to `late_s`
UP: Final = "up"  # all vehicles of `names` are armed, and take off
PROMOTE: Final = "promote"  # a vehicle becomes the leader of all
PAUSE: Final = "pause"  # all come to rest on their ways
GO_ON: Final = "go on"
OWN_VERBS: Final = frozenset({END, STOP, IMPAIR, UP, PROMOTE, PAUSE, GO_ON})
TYPES: Final = ("coaxial", "betaflight")
SECONDS: Final = 13.0  # in which things happen
FLOWN_S: Final = 8.0  # shortest flight
AFTER_S: Final = 3.0  # time after the last happening until all land
PLACES_M: Final = ((0.0, 0.0), (-0.6, 0.6), (-0.6, -0.6), (0.6, 0.6), (0.6, -0.6), (-0.9, 0.0))
MOST: Final = len(PLACES_M)  # vehicles that have places in the volume
WEATHER: Final = ("helicopter", "helicopters")
FILE: Final = (files(__package__) / "fleet.template").read_text("utf-8")
VEHICLE: Final = """
[vehicles.{name}]
type = "{type}"
subject = "{name}"
transmitter = {{ port = "radio-{name}", model_match = {number} }}
{follow}
"""


class Happening(Struct, frozen=True, forbid_unknown_fields=True):
    """A request or fault: `verb` with its `fields` for a `unit`, `at_s` after the fleet is ready."""

    at_s: float
    verb: str
    unit: str = ""
    fields: dict[str, Any] = {}


class Flight(Struct, frozen=True, forbid_unknown_fields=True):
    """A flight, which is the same at every repetition; vehicles are `v1`, `v2` ..., all follow the first."""

    seed: int  # of the simulated laboratory
    types: tuple[str, ...]  # of the vehicles
    weather: str
    rate_hz: int
    seconds: float  # until all land
    happenings: tuple[Happening, ...]
    horizon: int = 18

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        return tuple(f"v{number}" for number in range(1, len(self.types) + 1))

    def file(self, port: int) -> FleetFile:
        """Return the fleet, whose Tracker is at a port of this computer."""
        text = FILE.format(
            port=port, weather=self.weather, seed=self.seed, rate_hz=self.rate_hz, horizon=self.horizon
        )
        for number, (name, kind) in enumerate(zip(self.vehicles, self.types, strict=True), 1):
            x, y = PLACES_M[number - 1]
            link = f'follow = [{{ leader = "v1", offset_m = [{x}, {y}, 0.0] }}]' if number > 1 else ""
            text += VEHICLE.format(name=name, type=kind, number=number, follow=link)
        return parse_fleet(text)

    def save(self, path: Path) -> None:
        """Write a file that `read_flight` reads."""
        path.write_bytes(msgspec.json.format(msgspec.json.encode(self)) + b"\n")


def read_flight(path: Path) -> Flight:
    """Read a flight; raises `OSError` and `msgspec.MsgspecError`."""
    flight = msgspec.json.decode(path.read_bytes(), type=Flight)
    for happening in flight.happenings:
        if happening.verb not in OWN_VERBS:
            request_of(happening)
    return flight


def request_of(happening: Happening) -> Request:
    """Return the request that a happening is; raises `msgspec.ValidationError`."""
    if happening.verb not in VERBS:
        raise msgspec.ValidationError(f"no happening {happening.verb!r}")
    return msgspec.convert(happening.fields, VERBS[happening.verb].request)


def drawn_flight(seed: int, vehicles: Sequence[int] = (1, 2, 3), types: Sequence[str] = TYPES) -> Flight:
    """Draw a flight; `vehicles` are the numbers and `types` the types that a fleet may have."""
    chance = random.Random(seed)
    flown = tuple(chance.choice(types) for _ in range(chance.choice(vehicles)))
    names = [f"v{number}" for number in range(1, len(flown) + 1)]
    up = Happening(0.0, UP, fields={"names": names, "height_m": round(chance.uniform(0.5, 1.2), 2)})
    count = min(1 + int(chance.expovariate(0.4)), 12)
    later = [happening for _ in range(count) for happening in _drawn(chance, names)]
    later.sort(key=lambda one: one.at_s)
    return Flight(
        seed=seed,
        types=flown,
        weather=chance.choice(WEATHER),
        rate_hz=chance.choice((50, 50, 50, 100)),
        seconds=max(FLOWN_S, later[-1].at_s + AFTER_S),
        happenings=(up, *later),
    )


def _drawn(chance: random.Random, names: list[str]) -> Iterator[Happening]:
    """Draw what happens at one moment, in a third of all cases with something else soon after it."""
    at_s = round(chance.uniform(0.0, SECONDS), 3)
    kinds, weights = zip(*KINDS.items(), strict=True)
    while True:
        verb, unit, fields = chance.choices(kinds, weights)[0](chance, names)
        yield Happening(at_s, verb, unit, fields)
        at_s = round(at_s + chance.uniform(0.0, 0.5), 3)
        if chance.random() > 1 / 3:
            return


Drawn = tuple[str, str, dict[str, Any]]  # verb, unit, fields


def _request(chance: random.Random, names: list[str]) -> Drawn:
    """Something that a person requests of a vehicle, at a good or at a bad moment."""
    verb = chance.choice(("land", "lead", "disarm", "take_off", "arm", "go_to", "follow", "tune"))
    name, fields = chance.choice(names), dict[str, Any]()
    if verb == "take_off":
        fields = {"height_m": round(chance.uniform(0.3, 1.5), 2)}
    if verb == "go_to":
        place = [round(chance.uniform(low, high), 2) for low, high in ((-0.8, 0.8), (-0.8, 0.8), (0.3, 1.8))]
        fields = {
            "set_point": {"position_m": place, "yaw_rad": round(chance.uniform(-math.pi, math.pi), 2)},
            "turns": chance.choice((0, 0, 1)),
        }
    if verb == "follow":
        offset = [round(chance.uniform(-0.9, 0.9), 2) for _ in range(2)] + [0.0]
        fields = {"following": [{"leader": chance.choice(names), "offset_m": offset}]}
    if verb == "tune":
        fields = {"controller_settings": {"horizon": chance.choice((10, 30))}}
    return verb, name, fields


def _promotion(chance: random.Random, names: list[str]) -> Drawn:
    return PROMOTE, chance.choice(names), {}


def _pause(chance: random.Random, _: list[str]) -> Drawn:
    return chance.choice((PAUSE, GO_ON)), "", {}


def _kill(chance: random.Random, names: list[str]) -> Drawn:
    return chance.choice(("kill", "reset")), chance.choice(names), {}


def _process(chance: random.Random, names: list[str]) -> Drawn:
    process = chance.choice((TRACKER, TRANSMITTERS, *map(agent_process, names)))
    if chance.random() < 0.6:
        return END, process, {}
    return STOP, process, {"seconds": round(chance.uniform(0.02, 0.6), 3)}


def _messages(chance: random.Random, _: list[str]) -> Drawn:
    how = chance.choice(("lost", "doubled", "late_s"))
    figure = chance.uniform(0.005, 0.06) if how == "late_s" else chance.uniform(0.02, 0.5)
    return IMPAIR, "", {how: round(figure, 3), "seconds": round(chance.uniform(0.2, 3.0), 2)}


def _pose(chance: random.Random, names: list[str]) -> Drawn:
    subject, kind = chance.choice(names), chance.choice(POSE_FAULTS)
    fault: dict[str, Any] = {"kind": kind, "duration_s": round(chance.uniform(0.04, 4.0), 2)}
    if kind in OF_SUBJECT:
        fault["subject"] = subject
    if kind == "displace_pose":
        fault["offset_m"] = [round(chance.uniform(-0.5, 0.5), 2) for _ in range(3)]
    if kind == "turn_pose":
        fault["yaw_rad"] = round(chance.uniform(-math.pi, math.pi), 2)
    if kind == "swap_subjects":
        fault["other"] = chance.choice([name for name in names if name != subject] or [subject])
    return "inject", SIMULATOR_UNIT, {"faults": [{"at_s": 0.0, "fault": fault}]}


def _radio(chance: random.Random, names: list[str]) -> Drawn:
    condition, vehicle = chance.choice(("unplugged", "adapter", "off")), chance.choice(names)
    fault: dict[str, Any] = {"kind": "break_radio", "vehicle": vehicle, "condition": condition}
    fault["duration_s"] = round(chance.uniform(0.05, 1.5), 2)
    return "inject", SIMULATOR_UNIT, {"faults": [{"at_s": 0.0, "fault": fault}]}


def _tracker(chance: random.Random, _: list[str]) -> Drawn:
    kind = chance.choice(("close", "reset", "reset_frame_id", "burst", "wrong_magic"))
    return "inject", SIMULATOR_UNIT, {"faults": [{"at_s": 0.0, "fault": {"kind": kind}}]}


OF_SUBJECT: Final = (
    "occlude", "remove_subject", "freeze_pose", "stand_in", "displace_pose", "turn_pose", "swap_subjects"
)  # fmt: skip
POSE_FAULTS: Final = (*OF_SUBJECT, "silence", "freeze", "delay", "skip_frames", "add_noise")
KINDS: Final[Mapping[Callable[[random.Random, list[str]], Drawn], float]] = {
    _request: 5.0, _pause: 1.0, _promotion: 2.0, _kill: 0.5, _process: 4.0, _messages: 2.0, _pose: 2.0,
    _radio: 0.7, _tracker: 1.0,
}  # fmt: skip
"""What may happen, with its weight."""
