"""Mutation scores of the safety functions: arbiter, closed-loop landing, watchdog, transmitter, supervisor.

    make mutation

changes the code in many small ways, one after the other, and counts which changes the unit tests detect.
mutmut changes functions (settings in pyproject.toml) in a copy of the tree, because it does not follow the
links in `rcopterx/`. This module changes the rows of the arbiter's transition table, which are no
functions. The exit code is 1 if a score is below the least one of its group.
"""

import importlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[1]
COPY: Final = ROOT / "build" / "mutation"
SURVIVED: Final = (0, 33)
"""Codes of mutmut: the tests pass, or no test runs the function."""
GATEWAY: Final = "rcopterx/transmitter_gateway"
GROUPS: Final = {
    "arbiter": [f"{GATEWAY}/{name}.py" for name in ("arbiter", "pose_monitor")],
    "closed-loop landing": [f"{GATEWAY}/{name}.py" for name in ("landing", "output_limiter", "take_over")],
    "watchdog": [f"rcopterx/deploy/watchdog/{name}.py" for name in ("watchdog", "processor_time")],
    "transmitter": [
        f"{GATEWAY}/{name}.py"
        for name in ("command_validator", "transmitter", "switches", "state_page", "serial_port")
    ],
    "gateway process": [f"{GATEWAY}/process.py"],
    "supervisor": ["rcopterx/deploy/processes/supervisor.py"],
}
LEAST_SCORES: Final = {
    "arbiter": 0.9,
    "closed-loop landing": 0.9,
    "watchdog": 0.9,
    "transmitter": 0.85,
    "gateway process": 0.85,
    "supervisor": 0.85,
    "transition table": 0.9,
}
TABLE_TESTS: Final = (
    *("transitions", "arbiter_edges", "land_state", "arming", "kill_and_lease", "late_commands", "takeover"),
    *("arbiter", "descent", "landing_flights"),
)
"""Tests of behaviour; the comparison of the table with its page would detect every change."""


class Score(NamedTuple):
    """Number of changes, and the names of those that no test detects."""

    changes: int
    survivors: Sequence[str]

    @property
    def share(self) -> float:
        """Share of detected changes."""
        return 1.0 - len(self.survivors) / self.changes


def copy_tree() -> None:
    """Make the copy, with folders where links are."""
    shutil.rmtree(COPY, ignore_errors=True)
    without = shutil.ignore_patterns("__pycache__")
    for folder in ("rcopterx", "tests", "docs"):
        shutil.copytree(ROOT / folder, COPY / folder, ignore=without)
    shutil.copy(ROOT / "pyproject.toml", COPY)


def score_functions() -> dict[str, Score]:
    """Let mutmut change functions; scores by group."""
    environment = {**os.environ, "PYTHONPATH": str(COPY)}
    subprocess.run([sys.executable, "-m", "mutmut", "run"], cwd=COPY, env=environment, check=True)
    return {group: _score_of(files) for group, files in GROUPS.items()}


def _score_of(files: Sequence[str]) -> Score:
    codes: dict[str, int] = {}
    for file in files:
        found = json.loads((COPY / "mutants" / f"{file}.meta").read_text(encoding="utf-8"))
        codes |= found["exit_code_by_key"]
    return Score(len(codes), [name for name, code in codes.items() if code in SURVIVED])


def score_table() -> Score:
    """Change the rows of the transition table."""
    pytest = importlib.import_module("pytest")
    transitions = importlib.import_module("rcopterx.transmitter_gateway.transitions")
    tests = [f"tests/transmitter_gateway/test_{name}.py" for name in TABLE_TESTS]
    arguments = ["-q", "-x", "-p", "no:cacheprovider", *tests]
    # What is imported once need not be imported for every change.
    pytest.main(["--collect-only", "-q", *arguments])

    def notice(rows: Sequence[Any]) -> bool:
        child = os.fork()
        if child == 0:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            transitions.TRANSITIONS = tuple(rows)
            os._exit(int(pytest.main(arguments)))
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0

    if notice(transitions.TRANSITIONS):
        sys.exit("the tests fail without any change")
    survivors, changes = [], 0
    for name, rows in changed_tables(transitions.TRANSITIONS):
        changes += 1
        if not notice(rows):
            survivors.append(name)
        print(f"transition table: {changes} changes, {len(survivors)} not noticed", end="\r", flush=True)
    print()
    return Score(changes, survivors)


def changed_tables(rows: Sequence[Any]) -> Iterator[tuple[str, list[Any]]]:
    """Tables with one row less, or with one condition or state of a row less; with the change's name."""
    for place, row in enumerate(rows):
        name = f"row {place + 1} ({row.reason})"
        yield f"{name} left out", [*rows[:place], *rows[place + 1 :]]
        for field in ("states", "needs", "unless"):
            members = getattr(row, field)
            for member in sorted(members):
                changed = replace(row, **{field: members - {member}})
                yield f"{name} without {field} {member.name}", [*rows[:place], changed, *rows[place + 1 :]]


def main() -> int:
    """Print the scores and what was not noticed."""
    copy_tree()
    scores = {**score_functions(), "transition table": score_table()}
    for group, score in scores.items():
        print(*score.survivors, sep="\n")
        noticed = score.changes - len(score.survivors)
        print(f"{group}: {noticed} of {score.changes} changes noticed, {score.share:.1%}")
    print("`mutmut show NAME` in build/mutation shows a change")
    return 0 if all(score.share >= LEAST_SCORES[group] for group, score in scores.items()) else 1


if __name__ == "__main__":
    sys.exit(main())
