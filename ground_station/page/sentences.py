"""The state of fleet and vehicles in words, and how much attention it needs."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, Literal

from msgspec import Struct, convert

from rcopterx.ground_station.quantities import battery_low, hover
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.tables import table_beside
from rcopterx.vehicles.phases import Phase

Level = Literal["off", "calm", "busy", "amber", "red"]
DOWN_S: Final = 2.0  # age of the newest status of all vehicles from which a fleet counts as down

_TABLE: Final = table_beside(__file__, "sentences")
_PHASES: Final = convert(_TABLE["phases"], dict[str, tuple[str, str, Level]])
_TAKEN_OVER: Final = convert(_TABLE["taken_over"], dict[str, tuple[str, Level]])


class Words(Struct, frozen=True):
    """A text and how much attention it needs."""

    text: str
    level: Level


def chip(state: VehicleState) -> Words:
    """State of a vehicle in at most two words."""
    if state.silent and state.transmitter_state != "killed":
        return Words("silent", "red" if state.airborne else "off")
    if state.alarming:
        return taken_over(state)
    text, _, level = _PHASES.get(state.phase, (state.phase, "", "off"))
    return Words(text, level)


def taken_over(state: VehicleState) -> Words:
    """What the transmitter gateway does, or has done, with a vehicle that its agent does not fly."""
    if state.transmitter_state == "cut" and state.reason.startswith("landed"):
        return Words("was landed", "amber")
    return Words(*_TAKEN_OVER[state.transmitter_state])


def battery(state: VehicleState) -> Words:
    """Voltage and least flight time, or the share of the thrust that hovering needs; empty if unknown."""
    share = None if state.agent is None else state.agent.diagnostics.hover_thrust
    hovers = "" if share is None else f"hover {100 * share:.0f} %"
    return Words(state.battery_text.partition(" left")[0] or hovers, "red" if battery_low(state) else "calm")


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
    chips = {state.name: chip(state) for state in states}
    if all(words.text == "KILLED" for words in chips.values()):
        return Words("KILLED: all motors are cut; Reset before the next take-off", "red")
    levels = {words.level for words in chips.values()}
    parts = _named({state.name: chips[state.name].text for state in states if state.alarming})
    flying = [state for state in states if state.airborne and not state.alarming]
    error_m = [state.error_m for state in flying if state.assigned and state.error_m is not None]
    parts += _counted(flying)
    if error_m:
        parts.append(f"formation within {1000 * max(error_m):.0f} mm")
    if problems:
        others = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        parts, levels = [f"not ready: {problems[0]}{others}"], levels | {"amber"}
    elif not any(state.airborne for state in states):
        parts += _counted([state for state in states if state.phase == Phase.ARMED]) or ["ready to take off"]
    if any(state.airborne and battery_low(state) for state in states):
        levels.add("amber")
    level: Level = "red" if "red" in levels else "amber" if "amber" in levels else "calm"
    return Words(", ".join(parts), level)


def _named(texts: Mapping[str, str]) -> list[str]:
    return [
        f"{', '.join(name for name, own in texts.items() if own == text)} {text}"
        for text in dict.fromkeys(texts.values())
    ]


def _counted(states: Sequence[VehicleState]) -> list[str]:
    counts = {phase: sum(state.phase == phase for state in states) for phase in _PHASES}
    return [f"{count} {_PHASES[phase][count > 1]}" for phase, count in counts.items() if count]


def learned(state: VehicleState) -> list[str]:
    """What a vehicle has learned of itself."""
    if state.agent is None:
        return []
    values, model = state.agent.diagnostics, ", ".join(state.agent.diagnostics.model)
    texts = (
        hover(values),
        values.effort_factor > 1.0
        and f"oscillated: sticks weigh {values.effort_factor:g} times as much until it is tuned",
        state.learned or (model and f"flies with an identified model: {model}"),
    )
    return [text for text in texts if text]


def suggestions(leaders: Sequence[str], followers: Sequence[str]) -> str:
    """What to try in flight, in one sentence."""
    others = "".join(f"choose another leader for {name}, " for name in followers[-1:])
    kill = f"kill an agent by rcopterx inject kill_agent {leaders[0]}"
    return f"In flight: drag the handle of {leaders[0]}, {others}or {kill}"
