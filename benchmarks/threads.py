"""Processor time, wake-ups and page faults of each thread of a fleet in flight.

    python -m rcopterx.benchmarks.threads --vehicles 3 --horizon 50

The fleet is that of `rcopterx bench scale`. Threads called `app` are Zenoh's; they receive and send.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rcopterx.benchmarks.scale import fly_legs, in_formation

HORIZON: Final = 50
LEAST_WAKEUPS_HZ: Final = 0.5
"""Threads that wake up more rarely are not told."""
PROC: Final = Path("/proc")


@dataclass(frozen=True, slots=True)
class Usage:
    """What a thread has used since its start (proc(5)).

    Attributes
    ----------
    name
        Of the thread.
    run_s
        Time on a processor.
    waits, preemptions
        How often it went to sleep, and how often another one took its processor.
    faults
        Pages that had to be mapped.
    """

    name: str
    run_s: float
    waits: float
    preemptions: float
    faults: float

    def per_second(self, before: "Usage", seconds: float) -> "Usage":
        """Mean rates since an earlier moment."""
        return Usage(
            self.name,
            (self.run_s - before.run_s) / seconds,
            (self.waits - before.waits) / seconds,
            (self.preemptions - before.preemptions) / seconds,
            (self.faults - before.faults) / seconds,
        )


def threads_of(process: int, proc: Path = PROC) -> dict[int, Usage]:
    """Usage of each thread of a process by its number; those that end meanwhile are left out."""
    found = {}
    for directory in (proc / str(process) / "task").iterdir():
        try:
            stat, scheduled, status = (
                (directory / name).read_text() for name in ("stat", "schedstat", "status")
            )
        except (FileNotFoundError, ProcessLookupError):
            continue
        switches = dict(line.split(":\t", 1) for line in status.splitlines() if "ctxt_switches" in line)
        found[int(directory.name)] = Usage(
            stat[stat.index("(") + 1 : stat.rindex(")")],
            int(scheduled.split()[0]) / 1e9,
            int(switches["voluntary_ctxt_switches"]),
            int(switches["nonvoluntary_ctxt_switches"]),
            int(stat.rpartition(")")[2].split()[7]),
        )
    return found


def measured(vehicles: int, horizon: int, seconds: float) -> dict[str, list[Usage]]:
    """Rates of the threads of each process, by its name, those first that compute most."""
    with in_formation(vehicles, horizon) as (fleet, launcher):
        supervisor = launcher.supervisor
        processes = {name: pid for name in supervisor.children if (pid := supervisor.pid(name))}
        before = {name: threads_of(pid) for name, pid in processes.items()}
        began_s = time.monotonic()
        fly_legs(fleet, seconds)
        flown_s = time.monotonic() - began_s
        after = {name: threads_of(pid) for name, pid in processes.items()}
    return {name: rates(before[name], after[name], flown_s) for name in processes}


def rates(before: dict[int, Usage], after: dict[int, Usage], seconds: float) -> list[Usage]:
    """Rates of the threads that were there all the time, those first that compute most."""
    common = [after[thread].per_second(before[thread], seconds) for thread in after if thread in before]
    return sorted(common, key=lambda usage: usage.run_s, reverse=True)


def table(processes: dict[str, list[Usage]]) -> list[str]:
    """Lines for people."""
    lines = [
        f"{'process, thread':34}{'one processor':>14}{'wake-ups/s':>12}{'preempted/s':>12}{'faults/s':>10}"
    ]
    for name, threads in processes.items():
        lines.append(f"{name:34}{sum(usage.run_s for usage in threads):>14.1%}")
        lines += [
            f"  {usage.name:32}{usage.run_s:>14.1%}{usage.waits:>12.0f}{usage.preemptions:>12.0f}"
            f"{usage.faults:>10.0f}"
            for usage in threads
            if usage.waits >= LEAST_WAKEUPS_HZ
        ]
    return lines


def main(arguments: Sequence[str] | None = None) -> None:
    """Fly a fleet and print what its threads need."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicles", type=int, default=3, metavar="N")
    parser.add_argument("--horizon", type=int, default=HORIZON, metavar="N")
    parser.add_argument("--seconds", type=float, default=20.0, metavar="S")
    options = parser.parse_args(arguments)
    print("\n".join(table(measured(options.vehicles, options.horizon, options.seconds))))


if __name__ == "__main__":
    main()
