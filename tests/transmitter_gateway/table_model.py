"""The arbiter's table as a transition system for z3, with any facts and any times between steps.

The rows are those of `transitions.py`, read as data. `MEANINGS` gives every condition the meaning that
`arbiter.py` gives it: a term over the ages and facts of a moment. Facts that the model leaves free, such as
poses, link and requests, may have any value that the meanings permit.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import z3

from rcopterx.bus.message import LONGEST_PERIOD_S
from rcopterx.radios.limits import LONGEST_DESCENT_S, ArbiterLimits
from rcopterx.transmitter_gateway.inputs import FLYING, State
from rcopterx.transmitter_gateway.output_limiter import FADE_PER_S
from rcopterx.transmitter_gateway.transitions import Condition, Transition

LIMITS = ArbiterLimits()
DESCENT_S = LONGEST_DESCENT_S
BRIDGED_S = LIMITS.bridge_s + LONGEST_PERIOD_S
FADED_S = DESCENT_S + 1.0 / FADE_PER_S
ON_THE_WAY_DOWN = {State.LAND, State.DESCEND}
REQUESTS = (Condition.KILL, Condition.RESET, Condition.ARM, Condition.DISARM, Condition.TAKE_OVER)
AGES = {
    "command_s": "newest command",
    "pose_s": "newest pose",
    "entered_s": "in this state for",
    "landing_s": "landing for",
    "low_s": "thrust low for",
}
LONGEST_TRACE = 8
COMMANDED = "only armed vehicles are commanded, and ARMED and HOLD are states of commanded ones"
_SORT, _VALUES = z3.EnumSort("State", [state.value for state in State])
VALUE = dict(zip(State, _VALUES, strict=True))


class Moment:
    """Variables of one step: the state before it, ages [s], facts, and what an observer remembers.

    `commanded` is the arbiter's; `armed` is true from arming to the end of the flight.
    """

    def __init__(self, number: int) -> None:
        self.state = z3.Const(f"state{number}", _SORT)
        self.ages = {name: z3.Real(f"{name}{number}") for name in AGES}
        self.facts = {condition: z3.Bool(f"{condition}{number}") for condition in Condition}
        self.commanded, self.armed = z3.Bools(f"commanded{number} armed{number}")
        self.row = z3.Int(f"row{number}")

    def within(self, states: set[State] | frozenset[State]) -> z3.BoolRef:
        """Whether the state is one of `states`."""
        return z3.Or([self.state == VALUE[state] for state in State if state in states])

    def old(self, age: str, limit_s: float) -> z3.BoolRef:
        """Whether an age has reached a limit."""
        return self.ages[age] >= limit_s

    def holds(self, condition: Condition) -> z3.BoolRef:
        """Whether a condition holds, by its meaning."""
        if condition not in MEANINGS:
            raise AssertionError(f"the model has no meaning for the condition {condition!r}: add it")
        return MEANINGS[condition](self)


def _stream(m: Moment) -> z3.BoolRef:
    """Whether commands count; only then is their age judged."""
    return z3.Or(m.commanded, m.facts[Condition.ARM])


def _grounded(m: Moment) -> z3.BoolRef:
    return z3.And(m.within(FLYING), m.old("low_s", LIMITS.arm_low_s))


def _judged(condition: Condition) -> Callable[[Moment], z3.BoolRef]:
    """A judgement of poses; a flying vehicle on the floor is left alone."""
    return lambda m: z3.And(m.facts[condition], z3.Not(_grounded(m)))


def _of_pose(condition: Condition) -> Callable[[Moment], z3.BoolRef]:
    return lambda m: z3.And(_judged(condition)(m), z3.Not(m.old("pose_s", LIMITS.landing.pose_age_s)))


def _fact(condition: Condition) -> Callable[[Moment], z3.BoolRef]:
    return lambda m: m.facts[condition]


C = Condition
MEANINGS: dict[Condition, Callable[[Moment], z3.BoolRef]] = {
    **{condition: _fact(condition) for condition in (*REQUESTS, C.SHUTDOWN, C.LINK_LOST, C.THRUST_WANTED)},
    C.READY: lambda m: z3.And(m.facts[C.READY], z3.Not(m.facts[C.LINK_LOST])),
    C.FRESH: lambda m: z3.And(_stream(m), z3.Not(m.old("command_s", LIMITS.hold_after_s))),
    C.BRIDGING: lambda m: z3.And(_stream(m), m.facts[C.BRIDGING], z3.Not(m.old("command_s", BRIDGED_S))),
    C.SILENT: lambda m: z3.And(_stream(m), m.old("command_s", LIMITS.descend_after_s)),
    C.GONE: lambda m: z3.And(_stream(m), m.old("command_s", LIMITS.cut_after_s)),
    C.LOW_COMMANDED: lambda m: z3.And(_stream(m), m.facts[C.LOW_COMMANDED]),
    C.GIVEN_UP: lambda m: z3.And(_stream(m), m.facts[C.GIVEN_UP]),
    C.GROUNDED: _grounded,
    C.IDLE: lambda m: z3.And(
        m.within({State.ARMED}),
        *(m.old(age, LIMITS.disarm_after_s) for age in ("low_s", "entered_s")),
    ),
    C.SEEN: _of_pose(C.SEEN),
    C.AIRBORNE: lambda m: z3.And(
        _of_pose(C.SEEN)(m), m.facts[C.AIRBORNE], z3.Not(m.facts[C.LIFT_OFF]), z3.Not(m.facts[C.SINKING])
    ),
    C.RUNAWAY: lambda m: z3.And(_of_pose(C.SEEN)(m), m.facts[C.RUNAWAY], m.within(ON_THE_WAY_DOWN)),
    C.TOUCHDOWN: lambda m: z3.And(
        _of_pose(C.SEEN)(m), m.facts[C.TOUCHDOWN], m.within(ON_THE_WAY_DOWN), z3.Not(m.facts[C.RUNAWAY])
    ),
    C.IMPLAUSIBLE: lambda m: z3.And(
        m.facts[C.IMPLAUSIBLE], z3.Or(_grounded(m), z3.Not(m.within(FLYING)))
    ),
    C.LIFT_OFF: lambda m: z3.And(m.within(FLYING), m.facts[C.LIFT_OFF], z3.Not(m.facts[C.SINKING])),
    C.SINKING: lambda m: z3.And(m.within(FLYING), m.facts[C.SINKING]),
    C.HOLD_CAUSE: _judged(C.HOLD_CAUSE),
    C.DESCEND_CAUSE: _judged(C.DESCEND_CAUSE),
    C.HOLD_OVER: lambda m: z3.And(m.within({State.HOLD}), m.old("entered_s", LIMITS.hold_limit_s)),
    C.DESCENT_OVER: lambda m: z3.And(m.within({State.DESCEND}), m.old("entered_s", DESCENT_S)),
    C.LANDING_OVER: lambda m: z3.And(m.within(ON_THE_WAY_DOWN), m.old("landing_s", LIMITS.landing.longest_s)),
}  # fmt: skip


def assumptions(m: Moment) -> z3.BoolRef:
    """What `arbiter.py` guarantees of every moment."""
    faded_s = m.ages["entered_s"] - FADED_S
    return z3.And(
        z3.AtMost(*(m.facts[request] for request in REQUESTS), 1),
        z3.Implies(m.facts[C.RESET], m.within({State.KILLED})),
        z3.Implies(m.facts[C.ARM], z3.Not(m.within(FLYING))),
        z3.Implies(m.facts[C.TAKE_OVER], m.within({State.DISARMED})),
        # A descent of a vehicle that stays in the air ends without thrust.
        z3.Implies(z3.And(m.within({State.DESCEND}), faded_s >= 0), m.ages["low_s"] >= faded_s),
        *(age >= 0 for age in m.ages.values()),
    )


def start(m: Moment) -> z3.BoolRef:
    """A gateway that starts; it may take over a flight."""
    return z3.And(m.within({State.DISARMED}), z3.Not(m.commanded), z3.Not(m.armed), assumptions(m))


def step(rows: Sequence[Transition], m: Moment, n: Moment) -> z3.BoolRef:
    """One step of the arbiter from `m`; until `n` time passes, in which commands and poses may arrive."""
    number, target = z3.IntVal(0), m.state
    for index in range(len(rows), 0, -1):
        row = rows[index - 1]
        needs = [m.holds(condition) for condition in sorted(row.needs)]
        unless = [z3.Not(m.holds(condition)) for condition in sorted(row.unless)]
        fits = z3.And(m.within(row.states), *needs, *unless)
        number, target = z3.If(fits, index, number), z3.If(fits, VALUE[row.target], target)
    flying = n.within(FLYING)
    begins = z3.And(z3.Not(m.within(ON_THE_WAY_DOWN)), n.within(ON_THE_WAY_DOWN))
    arms = z3.And(z3.Not(m.within(FLYING)), n.within({State.ARMED}))
    took_over = z3.And(m.facts[C.TAKE_OVER], z3.Not(m.within(FLYING)))
    elapsed_s = z3.FreshReal("elapsed_s")
    older = {name: n.ages[name] == m.ages[name] + elapsed_s for name in AGES}
    renewed = {name: n.ages[name] <= elapsed_s for name in ("command_s", "pose_s", "low_s")}
    return z3.And(
        m.row == number,
        n.state == target,
        elapsed_s >= 0,
        *(z3.Or(older[name], renewed[name]) for name in renewed),
        z3.If(m.row > 0, n.ages["entered_s"] == elapsed_s, older["entered_s"]),
        z3.If(begins, n.ages["landing_s"] == elapsed_s, older["landing_s"]),
        # Who is taken over in ARMED or HOLD was armed before and is commanded.
        z3.Implies(z3.Not(flying), z3.And(z3.Not(n.commanded), z3.Not(n.armed))),
        z3.Implies(flying, z3.Or(took_over, n.commanded == z3.Or(m.commanded, arms))),
        z3.Implies(flying, n.armed == z3.If(took_over, n.commanded, z3.Or(m.armed, m.facts[C.ARM]))),
        assumptions(n),
    )


Promise = Callable[[Moment, Moment], z3.BoolRef]


class Counterexample(NamedTuple):
    """A way in which a table breaks a promise, from the start of the gateway if `reachable`."""

    promise: str
    reachable: bool
    lines: tuple[str, ...]

    def __str__(self) -> str:
        found = "" if self.reachable else f" (one step; not reached within {LONGEST_TRACE} steps)"
        return "\n  ".join([f"broken: {self.promise}{found}", *self.lines])


def counterexamples(rows: Sequence[Transition], promises: Mapping[str, Promise]) -> list[Counterexample]:
    """Prove by induction that no step breaks a promise; returns how the table breaks those it does not keep.

    The induction is over what is the case in every reachable state: `commanded` only in flight and only after
    arming, ARMED and HOLD only while commanded.
    """
    m, n = Moment(0), Moment(1)
    solver = z3.Solver()
    solver.add(step(rows, m, n), assumptions(m), _invariant(m))
    found = []
    for name, promise in {**promises, COMMANDED: lambda _, after: _invariant(after)}.items():
        if solver.check(z3.Not(promise(m, n))) != z3.unsat:
            trace = _trace(rows, promise)
            found.append(
                Counterexample(name, trace is not None, trace or _lines(rows, solver.model(), [m, n]))
            )
    return found


def _invariant(m: Moment) -> z3.BoolRef:
    return z3.And(
        z3.Implies(m.within({State.ARMED, State.HOLD}), m.commanded),
        z3.Implies(m.commanded, z3.And(m.armed, m.within(FLYING))),
    )


def _trace(rows: Sequence[Transition], promise: Promise) -> tuple[str, ...] | None:
    """Shortest way from the start to a step that breaks the promise, None if there is none so short."""
    moments = [Moment(0)]
    solver = z3.Solver()
    solver.add(start(moments[0]))
    for number in range(1, LONGEST_TRACE + 1):
        moments.append(Moment(number))
        solver.add(step(rows, *moments[-2:]))
        if solver.check(z3.Not(promise(*moments[-2:]))) == z3.sat:
            return _lines(rows, solver.model(), moments)
    return None


def _lines(rows: Sequence[Transition], model: z3.ModelRef, moments: Sequence[Moment]) -> tuple[str, ...]:
    return (*(_line(rows, model, m) for m in moments[:-1]), str(model[moments[-1].state]))


def _line(rows: Sequence[Transition], model: z3.ModelRef, m: Moment) -> str:
    number = model.eval(m.row).as_long()
    then = f"row {number}: {rows[number - 1].reason}" if number else "stays"
    return f"{model.eval(m.state)} [{'; '.join(_seen(model, m))}] -> {then}"


def _seen(model: z3.ModelRef, m: Moment) -> Iterator[str]:
    yield from (str(c) for c in Condition if z3.is_true(model.eval(m.holds(c), model_completion=True)))
    for name, words in AGES.items():
        age_s = model.eval(m.ages[name], model_completion=True)
        yield f"{words} {float(age_s.as_fraction()):.2f} s"
