"""The promises of docs/safety.md, counterexamplesd for every reachable state of the arbiter's table."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
import z3
from table_model import FADED_S, LIMITS, Moment, Promise, counterexamples

from rcopterx.transmitter_gateway.inputs import FLYING, State
from rcopterx.transmitter_gateway.transitions import TRANSITIONS, Condition, Transition

C = Condition


def stays_on_in_the_air(m: Moment, n: Moment) -> z3.BoolRef:
    """A vehicle that stands on something higher has touched down."""
    in_air = z3.And(m.holds(C.AIRBORNE), z3.Not(m.holds(C.TOUCHDOWN)))
    flew = z3.Or(m.within(FLYING), m.holds(C.TAKE_OVER))
    excused = z3.Or([m.holds(condition) for condition in (C.KILL, C.LINK_LOST, C.RUNAWAY)])
    return z3.Implies(z3.And(flew, in_air, z3.Not(excused)), n.within(FLYING))


def kill_dominates(m: Moment, n: Moment) -> z3.BoolRef:
    stays = z3.And(m.within({State.KILLED}), z3.Not(m.holds(C.RESET)))
    return z3.Implies(z3.Or(m.holds(C.KILL), stays), n.within({State.KILLED}))


def armed_by_arming(m: Moment, n: Moment) -> z3.BoolRef:
    """Also no other state of flight begins without arming, except by a take-over."""
    begun = z3.Or(m.within(FLYING), m.holds(C.ARM))
    armed = z3.Implies(n.within({State.ARMED}), z3.And(begun, n.armed))
    return z3.And(armed, z3.Implies(n.within(FLYING), z3.Or(begun, m.holds(C.TAKE_OVER))))


def rank(m: Moment, landing_s: z3.ArithRef) -> z3.ArithRef:
    """Stages of the end of a flight: commanded, held, landing, last descent, off."""
    landing = z3.If(z3.And(m.within({State.DESCEND}), landing_s >= LIMITS.landing.longest_s), 1, 2)
    held = z3.If(m.within({State.HOLD}), 3, landing)
    return z3.If(m.within(FLYING), z3.If(m.within({State.ARMED}), 4, held), 0)


def ends_by_time(m: Moment, n: Moment) -> z3.BoolRef:
    """No stage returns without fresh commands, and each one ends by its age: all of them within a minute."""
    begins = z3.And(z3.Not(m.within({State.LAND, State.DESCEND})), n.within({State.LAND, State.DESCEND}))
    before = rank(m, m.ages["landing_s"])
    after = rank(n, z3.If(begins, 0, m.ages["landing_s"]))
    over = z3.Or(
        z3.And(before == 4, m.old("command_s", LIMITS.descend_after_s)),
        z3.And(before == 3, m.old("entered_s", LIMITS.hold_limit_s)),
        z3.And(before == 2, m.old("landing_s", LIMITS.landing.longest_s)),
        z3.And(before == 1, m.old("entered_s", FADED_S + LIMITS.arm_low_s)),
    )
    alone = z3.And(m.within(FLYING), z3.Not(m.holds(C.FRESH)))
    return z3.Implies(alone, z3.And(after <= before, z3.Implies(over, after < before)))


PROMISES: dict[str, Promise] = {
    "never off while seen in the air": stays_on_in_the_air,
    "kill dominates": kill_dominates,
    "ARMED is reached only by arming": armed_by_arming,
    "every flying state ends by time alone": ends_by_time,
}


def test_table_keeps_its_promises_in_every_reachable_state() -> None:
    found = counterexamples(TRANSITIONS, PROMISES)
    assert not found, "\n".join(map(str, found))


def without(reason: str, to: State) -> Sequence[Transition]:
    """The table without a row."""
    return [row for row in TRANSITIONS if (row.reason, row.target) != (reason, to)]


def changed(reason: str, to: State, **changes: object) -> Sequence[Transition]:
    """The table with one changed row."""
    rows = [
        replace(row, **changes) if (row.reason, row.target) == (reason, to) else row for row in TRANSITIONS
    ]
    assert rows != list(TRANSITIONS)
    return rows


NOTHING: frozenset[Condition] = frozenset()
ON, KILL, ARM, TIME = PROMISES
MUTANTS: dict[str, tuple[Sequence[Transition], str]] = {
    "no kill": (without("killed", State.KILLED), KILL),
    "a kill that ends without a reset": (changed("kill reset", State.DISARMED, needs=NOTHING), KILL),
    "a reset that lands": (changed("kill reset", State.DISARMED, target=State.LAND), ARM),
    "a cut in the air when commands are gone": (changed("commands gone", State.CUT, unless=NOTHING), ON),
    "a cut in the air after a descent": (changed("descent over", State.CUT, unless=NOTHING), ON),
    "a cut without a touchdown": (changed("landed", State.CUT, needs=NOTHING), ON),
    "silent commands that disarm": (changed("commands silent", State.LAND, target=State.DISARMED), ON),
    "silent commands that change nothing": (without("commands silent", State.DESCEND), TIME),
    "a hold without an end": (without("hold lasted too long", State.DESCEND), TIME),
    "a descent without an end": (without("descent over", State.CUT), TIME),
    "landings for ever": (changed("own pose seen", State.LAND, unless=NOTHING), TIME),
    "old commands that count again": (
        changed("commands fresh again", State.ARMED, needs=frozenset({C.READY})),
        TIME,
    ),
    "a take-over that arms": (changed("taken over", State.LAND, target=State.ARMED), ARM),
    "a take-over while shutting down": (
        [replace(row, unless=row.unless | {C.SHUTDOWN}) for row in TRANSITIONS],
        ON,
    ),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_table_that_breaks_a_promise_is_refuted_by_a_way_from_the_start(name: str) -> None:
    rows, promise = MUTANTS[name]
    found = {example.promise: example for example in counterexamples(rows, PROMISES)}
    assert found[promise].reachable
    assert found[promise].lines[0].startswith("DISARMED [")


def test_counterexample_names_states_conditions_ages_and_rows() -> None:
    example, *_ = counterexamples(changed("descent over", State.CUT, unless=NOTHING), {ON: PROMISES[ON]})
    *_, last, end = str(example).splitlines()
    assert str(example).startswith("broken: never off while seen in the air\n")
    assert last.lstrip().startswith("DESCEND [")
    assert "own pose seen in the air; " in last
    assert "descent lasted its time; newest" in last
    number = [row.reason for row in TRANSITIONS].index("descent over") + 1
    assert last.endswith(f"row {number}: descent over")
    assert end.strip() == "CUT"


def test_condition_without_a_meaning_is_named() -> None:
    row = replace(TRANSITIONS[0], needs=frozenset({"moon full"}))
    with pytest.raises(AssertionError, match="moon full"):
        counterexamples([row], PROMISES)
