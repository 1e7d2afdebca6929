"""Bytecode instructions and calls of an agent's control period, by function.

    python -m rcopterx.benchmarks.instructions FLIGHT.mcap h2

replays the agent of a flight log and counts what the interpreter executes. Unlike times the counts do not
depend on what else a computer does, and where caches are cold they tell well what a period costs. Compiled
code counts as one call.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, Final

from rcopterx.flights.mcap_reading import FlightLogError
from rcopterx.ground_station.replay.agent_replay import control_periods
from rcopterx.ground_station.replay.recorded_agent import RecordedAgent, recorded_agent

SKIPPED: Final = 20
"""Periods in the beginning, in which what is kept for later ones is computed."""
FOLDER: Final = Path(__file__).resolve().parents[1]


@dataclass
class Counts:
    """What was executed in a number of control periods.

    Attributes
    ----------
    periods
        How many.
    instructions
        Of each function.
    calls
        How often each function was called, and functions that are not Python's by their names.
    """

    periods: int = 0
    instructions: Counter[CodeType] = field(default_factory=Counter)
    calls: Counter[CodeType | str] = field(default_factory=Counter)

    def trace(self, frame: FrameType, event: str, _: Any) -> Any:
        """For `sys.settrace`."""
        if event == "call":
            frame.f_trace_opcodes, frame.f_trace_lines = True, False
            self.calls[frame.f_code] += 1
        elif event == "opcode":
            self.instructions[frame.f_code] += 1
        return self.trace

    def profile(self, _: FrameType, event: str, function: Any) -> None:
        """For `sys.setprofile`."""
        if event == "c_call":
            self.calls[getattr(function, "__qualname__", repr(function))] += 1


def counted(recorded: RecordedAgent, skipped: int = SKIPPED) -> Counts:
    """Count what a replayed agent does after its first control periods."""
    counts = Counts()
    for life in recorded.lives:
        periods = control_periods(recorded.vehicle, recorded.fleet, life)
        for _ in zip(range(skipped), periods, strict=False):
            pass
        for _ in _watched(periods, counts):
            counts.periods += 1
    return counts


def _watched(periods: Iterator[Any], counts: Counts) -> Iterator[Any]:
    while True:
        sys.settrace(counts.trace)
        sys.setprofile(counts.profile)
        try:
            period = next(periods, None)
        finally:
            sys.settrace(None)
            sys.setprofile(None)
        if period is None:
            return
        yield period


def table(counts: Counts, most: int) -> list[str]:
    """Lines for people, functions first that take most; means of a period."""
    periods = max(1, counts.periods)
    python = sum(number for called, number in counts.calls.items() if isinstance(called, CodeType))
    others = counts.calls.total() - python
    lines = [
        f"{counts.instructions.total() / periods:.0f} instructions, {python / periods:.0f} calls of Python "
        f"functions and {others / periods:.0f} of others in a period, mean of {counts.periods}",
        f"{'instructions':>12}{'calls':>8}  function",
    ]
    for code, number in counts.instructions.most_common(most):
        lines.append(f"{number / periods:>12.0f}{counts.calls[code] / periods:>8.1f}  {_place(code)}")
    return lines


def _place(code: CodeType) -> str:
    path = Path(code.co_filename)
    place = path.relative_to(FOLDER) if path.is_relative_to(FOLDER) else Path(path.parent.name, path.name)
    return f"{code.co_qualname} ({place})"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("agent")
    parser.add_argument(
        "--skip", type=int, default=SKIPPED, metavar="N", help="control periods before it counts"
    )
    parser.add_argument("--most", type=int, default=40, metavar="N", help="functions that are told")
    arguments = parser.parse_args()
    try:
        recorded = recorded_agent([arguments.file], arguments.agent)
    except FlightLogError as error:
        print(error, file=sys.stderr)
        return 1
    print("\n".join(table(counted(recorded, arguments.skip), arguments.most)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
