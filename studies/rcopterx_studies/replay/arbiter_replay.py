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
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    NAMES,
    Action,
    ActionRequest,
    ArbiterOutput,
    CommandInput,
    LastApplied,
    LinkState,
    PoseInput,
)
from rcopterx.transmitter_gateway.process import pose_input
from rcopterx.transmitter_gateway.transmitter_node import NO_CAUSE, command_input
from rcopterx_studies.replay.agent_replay import Difference

T = TypeVar("T", PoseInput, CommandInput)
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
        self.poses: Inputs[PoseInput] = defaultdict(deque)
        self.commands: Inputs[CommandInput] = defaultdict(deque)
        self.applied: dict[float, deque[Applied]] = defaultdict(deque)  # by the time of writing
        wanted: set[tuple[str, channels.Channel[Any]]] = {
            (self.served[0], channels.ARBITER_CALLS),
            (vehicle, channels.APPLIED),
        }
        wanted |= {(name, channels.COMMAND) for name in self.served}
        wanted |= {(name, channels.POSE) for name in fleet.vehicles}
        kinds = {f"{unit}/{channel.topic}": channel.message for unit, channel in wanted}
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
        life = _Life(recorded, fleet, result)
        number = 0
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
        self._outputs: dict[str, ArbiterOutput] = {}
        self._reason = ""  # recorded reason of the vehicle's state

    def repeat(self, call: str, vehicle: str, now_s: float, arguments: tuple[Any, ...]) -> None:
        """Repeat a call; see `ArbiterCalls`."""
        recorded, arbiter = self._recorded, self._arbiters.get(vehicle)
        if call == "pose":
            if (pose := self._input(recorded.poses, vehicle, arguments)) is not None:
                explained_m = math.inf if arbiter is None else arbiter.lift_off.explained_m
                for each in self._arbiters.values():
                    each.pose(pose, now_s, explained_m)
        elif arbiter is not None:
            match call:
                case "command":
                    if (command := self._input(recorded.commands, vehicle, arguments)) is not None:
                        arbiter.command(command, now_s)
                case "step":
                    self._outputs[vehicle] = arbiter.step(now_s)
                case "bid":
                    agent, take_over, _ = arguments
                    arbiter.bid(agent, now_s, take_over=take_over)
                case "link":
                    state, problem = arguments
                    arbiter.link(LinkState(state), problem)
                case "request":
                    action, by = arguments
                    arbiter.request(ActionRequest(Action(action), by), now_s)
                case "resume":
                    commanding, issued = arguments
                    arbiter.leases.resume(commanding, issued, now_s)
                case "take_over":
                    arbiter.take_over(msgspec.convert(arguments, LastApplied), now_s)
                case "reason" if vehicle == recorded.vehicle:
                    (self._reason,) = arguments
                case "written" if vehicle == recorded.vehicle:
                    self._compare(arbiter, now_s)

    def _input(self, inputs: Inputs[T], vehicle: str, reference: tuple[Any, ...]) -> T | None:
        """Next pose or command with a reference; the last one stays, as a message can arrive twice."""
        if found := inputs.get((vehicle, *reference)):
            return found.popleft() if len(found) > 1 else found[0]
        self._result.missing_inputs += 1
        return None

    def _compare(self, arbiter: Arbiter, now_s: float) -> None:
        result, output = self._result, self._outputs.get(self._recorded.vehicle)
        written = self._recorded.applied.get(now_s)
        if not written or output is None:
            result.unmatched += 1
            return
        then, cause = written.popleft(), output.cause or NO_CAUSE
        result.frames += 1
        pairs = {
            "state": (NAMES[output.state], then.state),
            "reason": (arbiter.reason, self._reason),
            "command": (
                (arbiter.leases.commanding, cause.epoch, cause.frame, cause.sequence),
                (then.lease, then.epoch, then.frame, then.sequence),
            ),
            "input": (output.u, then.input),
        }
        differing = [name for name, (now, before) in pairs.items() if now != before]
        result.identical += not differing
        if differing and result.first is None:
            now, before = pairs[differing[0]]
            detail = f"{now} in place of {before}"
            if result.missing_inputs:
                detail = f"{result.missing_inputs} inputs so far are not in the flight log: {detail}"
            began_s = next(iter(self._recorded.lives.values()))[0].calls[0][2]
            result.first = Difference(now_s - began_s, then.frame, differing[0], detail)
