"""Runs the arbiters of a gateway on their recorded calls, and compares every frame with the written one."""

import math
from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import msgspec

from rcopterx.bus import channels
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.log_messages import ArbiterCalls
from rcopterx.bus.messages import Applied, Command, Pose
from rcopterx.fleet.radios import calibration_of
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import limits_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import LoggedMessage
from rcopterx.transmitter_gateway import inputs
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.process import pose_input
from rcopterx.transmitter_gateway.transmitter_node import NO_CAUSE, command_input
from rcopterx_studies.replay.agent_replay import Difference

T = TypeVar("T", inputs.PoseInput, inputs.CommandInput)
Inputs = dict[tuple[str, int, int], deque[T]]  # by vehicle, and epoch and frame or lease and sequence


class RecordedArbiters:
    """What a flight log has of the arbiters of the gateway that serves a vehicle."""

    def __init__(self, vehicle: str, fleet: FleetFile, messages: Iterable[LoggedMessage]) -> None:
        """Read messages; raises FlightLogError."""
        if vehicle not in fleet.vehicles:
            raise FlightLogError(f"{vehicle}: no such vehicle, the flight has {', '.join(fleet.vehicles)}")
        self.vehicle, self.fleet = vehicle, fleet
        self.served = fleet.served_by(fleet.vehicles[vehicle].transmitter.gateway)
        self.lives: dict[float, list[ArbiterCalls]] = defaultdict(list)  # processes of the gateway
        self.poses: Inputs[inputs.PoseInput] = defaultdict(deque)
        self.commands: Inputs[inputs.CommandInput] = defaultdict(deque)
        self.applied: dict[float, deque[Applied]] = defaultdict(deque)  # by the time of writing
        units: dict[channels.Channel[Any], Iterable[str]] = {
            channels.CALLS: self.served[:1],
            channels.APPLIED: [vehicle],
            channels.COMMAND: self.served,
            channels.POSE: fleet.vehicles,
        }
        kinds = {f"{unit}/{row.topic}": row.message for row, names in units.items() for unit in names}
        for topic, payload, *_ in messages:
            if topic in kinds:
                try:
                    self._add(topic.partition("/")[0], decode(payload, kinds[topic]))
                except RejectedError as error:
                    raise FlightLogError(f"{topic}: of another version: {error}") from None
        if not self.lives:
            raise FlightLogError(f"{vehicle}: the flight log has no calls of its arbiter, as older ones")

    def _add(self, unit: str, message: object) -> None:
        match message:
            case ArbiterCalls():
                self.lives[message.began_s].append(message)
            case Pose():
                self.poses[unit, message.epoch, message.frame].append(pose_input(unit, message))
            case Command():
                self.commands[unit, message.lease, message.sequence].append(command_input(message))
            case Applied():
                self.applied[message.written_s].append(message)


@dataclass
class ArbiterComparison:
    """Result of the replay of an arbiter."""

    vehicle: str
    frames: int = 0  # written frames that were compared
    identical: int = 0  # those with the same state, reason, command and input to the last bit
    missing_inputs: int = 0  # poses and commands that the flight log does not have
    unmatched: int = 0  # frames of which the flight log has only the call, or only the message
    flown_s: float = 0.0
    first: Difference | None = None
    notes: list[str] = field(default_factory=list)


def replay_arbiter(recorded: RecordedArbiters, fleet: FleetFile) -> ArbiterComparison:
    """Call the arbiters of a fleet file as the recorded ones; what `recorded` holds is used up."""
    result = ArbiterComparison(recorded.vehicle)
    for messages in recorded.lives.values():
        life, number = _Life(recorded, fleet, result), 0
        for message in messages:
            if message.number != number:
                result.notes.append(f"{message.number - number} calls after number {number} are missing")
            number = message.number + len(message.calls)
            for call in message.calls:
                life.repeat(*call)
        result.flown_s += messages[-1].calls[-1][2] - messages[0].calls[0][2]
    if silent := sum(map(len, recorded.applied.values())):
        result.unmatched += silent
        result.notes.append(f"{silent} frames without calls: those before the recording or a death")
    return result


class _Life:
    """One process of the gateway."""

    def __init__(self, recorded: RecordedArbiters, fleet: FleetFile, result: ArbiterComparison) -> None:
        self._recorded, self._result = recorded, result
        self._arbiters: dict[str, Arbiter] = {}
        for name in recorded.served:
            calibration = calibration_of(fleet, name)
            hover, slew_per_s = calibration.throttle.u_hover, calibration.slew_per_s
            self._arbiters[name] = Arbiter(name, limits_of(fleet, name), hover, slew_per_s)
        self._outputs: dict[str, inputs.ArbiterOutput] = {}
        self._reason = ""  # recorded reason of the vehicle's state

    def repeat(self, call: str, vehicle: str, now_s: float, arguments: tuple[Any, ...]) -> None:
        """Repeat a call; see `ArbiterCalls`."""
        recorded, arbiter = self._recorded, self._arbiters.get(vehicle)
        match call, arbiter, arguments:
            case "pose", _, _:
                if (pose := self._input(recorded.poses, vehicle, arguments)) is not None:
                    explained_m = math.inf if arbiter is None else arbiter.lift_off.explained_m
                    for each in self._arbiters.values():
                        each.pose(pose, now_s, explained_m)
            case "command", Arbiter(), _:
                if (command := self._input(recorded.commands, vehicle, arguments)) is not None:
                    arbiter.command(command, now_s)
            case "step", Arbiter(), _:
                self._outputs[vehicle] = arbiter.step(now_s)
            case "bid", Arbiter(), (agent, take_over, _):
                arbiter.bid(agent, now_s, take_over=take_over)
            case "link", Arbiter(), (state, problem):
                arbiter.link(inputs.LinkState(state), problem)
            case "request", Arbiter(), (action, by):
                arbiter.request(inputs.ActionRequest(inputs.Action(action), by), now_s)
            case "resume", Arbiter(), (commanding, issued):
                arbiter.leases.resume(commanding, issued, now_s)
            case "take_over", Arbiter(), _:
                arbiter.take_over(msgspec.convert(arguments, inputs.LastApplied), now_s)
            case "reason", _, (reason,) if vehicle == recorded.vehicle:
                self._reason = reason
            case "written", Arbiter(), _ if vehicle == recorded.vehicle:
                self._compare(arbiter, now_s)

    def _input(self, found: Inputs[T], vehicle: str, reference: tuple[Any, ...]) -> T | None:
        """Next pose or command with a reference; the last one stays, as a message can arrive twice."""
        if alike := found.get((vehicle, *reference)):
            return alike.popleft() if len(alike) > 1 else alike[0]
        self._result.missing_inputs += 1
        return None

    def _compare(self, arbiter: Arbiter, now_s: float) -> None:
        result, output = self._result, self._outputs.get(self._recorded.vehicle)
        written = self._recorded.applied.get(now_s)
        if not written or output is None:
            result.unmatched += 1
            return
        then, cause = written.popleft(), output.cause or NO_CAUSE
        command = (arbiter.leases.commanding, cause.epoch, cause.frame, cause.sequence)
        pairs = {
            "state": (inputs.NAMES[output.state], then.state),
            "reason": (arbiter.reason, self._reason),
            "command": (command, (then.lease, then.epoch, then.frame, then.sequence)),
            "input": (output.u, then.input),
        }
        differing = [name for name, (now, before) in pairs.items() if now != before]
        result.frames += 1
        result.identical += not differing
        if differing and result.first is None:
            detail = "{} in place of {}".format(*pairs[differing[0]])
            if result.missing_inputs:
                detail = f"{result.missing_inputs} inputs so far are not in the flight log: {detail}"
            began_s = next(iter(self._recorded.lives.values()))[0].calls[0][2]
            result.first = Difference(now_s - began_s, then.frame, differing[0], detail)
