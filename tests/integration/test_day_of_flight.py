"""A long flight leaves every process as it was: memory, open files, threads and logs do not grow.

Each process is sampled every minute of the fleet's time. RCOPTERX_DAY_MINUTES, at least 4,
shortens the flight.
"""

import os
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import NamedTuple

import pytest
from integration_support import NAMES, Flying, fleet_text

from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.fleet.reading import load_fleet

pytestmark = [
    pytest.mark.integration,
    pytest.mark.campaign,
    pytest.mark.lockstep,
    pytest.mark.timeout(14_400),
]

Launch = Callable[..., Flying]
MINUTES = int(os.environ.get("RCOPTERX_DAY_MINUTES", "120"))
"""Of the fleet's time; in lockstep they may be shorter."""
PLACES_M = ((0.3, 0.2, 0.9), (-0.3, 0.1, 0.7))
MB = 1_000_000
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
GROWTH_BYTES = 1.5 * MB
"""More than the allocator's fragments; a leak of a megabyte a minute is forty times as much."""
INDEX_BYTES = 8 * MB
"""Of the recorder: the index of the chunks of a part, which grows for half an hour and then begins anew."""
LOG_BYTES = 20_000


class Sample(NamedTuple):
    """Resources of a process."""

    memory_bytes: int
    files: int
    threads: int
    log_bytes: int


def sample(process: int, log: Path) -> Sample:
    proc = Path(f"/proc/{process}")
    return Sample(
        PAGE_BYTES * int((proc / "statm").read_text().split()[1]),
        len(list((proc / "fd").iterdir())),
        len(list((proc / "task").iterdir())),
        log.stat().st_size,
    )


def test_no_process_grows_in_two_hours_of_flight(launch: Launch, tmp_path: Path) -> None:
    text = fleet_text()
    flying = launch(f'{text}\n[log]\ndirectory = "{tmp_path / "flights"}"\n', record=True)
    fleet, file = flying.fleet, load_fleet(flying.path)
    logs = run_directory(file.name, file.bus.namespace) / "log"
    fleet.take_off(NAMES, height_m=0.7, timeout_s=60)
    fleet.wait_for_formation()
    samples: dict[str, list[Sample]] = defaultdict(list)
    for minute in range(MINUTES):
        fleet["h1"].go_to(PLACES_M[minute % 2], 0.2)
        fleet.wait_for_arrival(["h1"])
        end_s = flying.now_s() + 60.0
        fleet.wait_until(lambda end_s=end_s: flying.now_s() >= end_s, 70.0, "the time does not pass")
        flying.check_promises()
        for name in flying.launchers["main"].supervisor.running():
            samples[name].append(sample(flying.pid(name), logs / f"{name}.log"))
    fleet.land(NAMES, timeout_s=40)
    assert len(samples) == 8, "three agents, gateways, router, recorder and simulator"
    wrong = [f"{name}: {problem}" for name, found in samples.items() for problem in growth(name, found)]
    assert not wrong, "\n".join(wrong)


def figures(process: str, found: list[Sample]) -> str:
    """Means per minute, between the first and the last sample."""
    minutes = len(found) - 1
    changes = zip(Sample._fields, found[0], found[-1], strict=True)
    each = (f"{what} {first} + {(last - first) / minutes:g}" for what, first, last in changes)
    return f"{process}: {', '.join(each)} a minute"


def growth(process: str, found: list[Sample]) -> list[str]:
    """What has grown between the second quarter of a flight and the last one; the first one is a warm-up."""
    quarter = len(found) // 4
    early, late = found[quarter : 2 * quarter], found[-quarter:]
    allowed = {
        "memory_bytes": INDEX_BYTES if process == "recorder" else GROWTH_BYTES,
        "files": 0,
        "threads": 0,
        "log_bytes": LOG_BYTES,
    }
    grown = {
        what: median(getattr(each, what) for each in late) - median(getattr(each, what) for each in early)
        for what in allowed
    }
    print(figures(process, found))
    return [f"{what} + {grown[what]:g}" for what, most in allowed.items() if grown[what] > most]
