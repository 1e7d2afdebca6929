"""The state of fleet and vehicles in words, and how much attention it needs."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, Literal

from msgspec import Struct

from rcopterx.ground_station.quantities import battery_low
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.vehicles.phases import Phase

Level = Literal["off", "calm", "busy", "amber", "red"]
DOWN_S: Final = 2.0
"""Age of the newest status of all vehicles from which a fleet counts as down."""

_VERBS: Final = {
    Phase.FLYING: ("flies", "fly"),
    Phase.TAKEOFF: ("takes off", "take off"),
    Phase.LANDING: ("lands", "land"),
    Phase.EMERGENCY: ("is brought down", "are brought down"),
    Phase.ARMED: ("is armed", "are armed"),
    Phase.GROUND: ("on the floor", "on the floor"),
}
_CHIPS: Final[Mapping[str, tuple[str, Level]]] = {
    Phase.FLYING: ("flies", "calm"),
    Phase.TAKEOFF: ("takes off", "busy"),
    Phase.LANDING: ("lands", "busy"),
    Phase.EMERGENCY: ("brought down", "red"),
    Phase.ARMED: ("armed", "busy"),
    Phase.GROUND: ("on the floor", "off"),
    "hold": ("held", "amber"),
    "descend": ("brought down", "red"),
    "land": ("brought down", "red"),
    "cut": ("motors cut", "red"),
    "killed": ("KILLED", "red"),
}


class Words(Struct, frozen=True):
    """A text and how much attention it needs."""

    text: str
    level: Level


def chip(state: VehicleState) -> Words:
    """State of a vehicle in at most two words."""
    if state.silent and state.transmitter_state != "killed":
        return Words("silent", "red" if state.airborne else "off")
    if state.transmitter_state == "cut" and state.reason.startswith("landed"):
        return Words("was landed", "amber")
    known = state.transmitter_state if state.alarming else state.phase
    return Words(*_CHIPS.get(known, (known, "off")))


def battery(state: VehicleState) -> Words:
    """Voltage, or the share of the thrust that hovering needs; empty if neither is known."""
    status = None if state.transmitter is None else state.transmitter.battery
    if status is not None:
        return Words(f"{status.voltage_v:.2f} V", "red" if battery_low(state) else "calm")
    hover = None if state.agent is None else state.agent.diagnostics.hover_thrust
    return Words("" if hover is None else f"hover {100 * hover:.0f} %", "calm")


def radio(state: VehicleState) -> Words:
    """State of the radio in one word."""
    status = state.transmitter
    if status is None or state.transmitter_age_s is None or state.transmitter_age_s > DOWN_S:
        return Words("silent", "off")
    return Words("ready", "calm") if status.ready else Words(status.module or status.link, "amber")


def is_down(states: Collection[VehicleState]) -> bool:
    """Whether no process of any vehicle has reported for a while."""
    ages = [age_s for state in states for age_s in (state.agent_age_s, state.transmitter_age_s)]
    return all(age_s is None or age_s > DOWN_S for age_s in ages)


def down_sentence(name: str) -> Words:
    """Sentence about a fleet that is not up."""
    return Words(f"{name} is down; start it with rcopterx up {name}", "off")


def fleet_sentence(states: Sequence[VehicleState], problems: Sequence[str]) -> Words:
    """State of a fleet that is up, in one sentence; `problems` prevent its take-off."""
    killed = [state.name for state in states if state.transmitter_state == "killed"]
    if len(killed) == len(states):
        return Words("KILLED: all motors are cut; Reset before the next take-off", "red")
    flying = [state for state in states if state.airborne]
    taken = [state.name for state in flying if state.alarming]
    parts = [f"{', '.join(taken)} brought down by the transmitter gateway"] if taken else []
    parts += _counted([state for state in flying if not state.alarming])
    level: Level = "calm"
    if flying:
        error_mm = [
            1000 * state.error_m
            for state in flying
            if state.assigned and state.error_m is not None and not state.alarming
        ]
        if error_mm:
            parts.append(f"formation within {max(error_mm):.0f} mm")
    elif problems:
        others = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        parts, level = [f"not ready: {problems[0]}{others}"], "amber"
    else:
        armed = [state for state in states if state.phase == Phase.ARMED]
        parts = _counted(armed) or ["ready to take off"]
    if killed:
        parts.append(f"{', '.join(killed)} KILLED")
    elif any(state.alarming for state in states):
        parts += [
            f"{state.name}: {chip(state).text}" for state in states if state.alarming and not state.airborne
        ]
    if killed or taken:
        level = "red"
    elif any(state.alarming or (state.airborne and (state.silent or battery_low(state))) for state in states):
        level = "amber"
    return Words(", ".join(parts), level)


def _counted(states: Sequence[VehicleState]) -> list[str]:
    """How many vehicles are in each phase, in the order of `_VERBS`."""
    counts = {phase: sum(state.phase == phase for state in states) for phase in _VERBS}
    return [f"{count} {_VERBS[phase][count > 1]}" for phase, count in counts.items() if count]


def learned(state: VehicleState) -> list[str]:
    """What a vehicle has learned of itself."""
    if state.agent is None:
        return []
    values = state.agent.diagnostics
    found = (
        [] if values.hover_thrust is None else [f"hovers at {100 * values.hover_thrust:.0f} % of the thrust"]
    )
    if values.effort_factor > 1.0:
        found.append(f"oscillated: sticks weigh {values.effort_factor:g} times as much until it is tuned")
    if values.model:
        found.append(f"flies with an identified model: {', '.join(values.model)}")
    return found


def suggestions(leaders: Sequence[str], followers: Sequence[str]) -> str:
    """What to try in flight, in one sentence."""
    ideas = [f"drag the handle of {leaders[0]}"]
    if followers:
        ideas.append(f"choose another leader for {followers[-1]}")
    ideas.append(f'kill an agent by pkill -9 -xf "rcopterx agent {leaders[0]}"')
    return f"In flight: {', '.join(ideas[:-1])}, or {ideas[-1]}"
