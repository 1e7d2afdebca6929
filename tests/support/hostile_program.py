"""Hostile programs that fly a vehicle from outside: `python hostile_program.py KIND FOLDER FLEET ...`.

Sound for a second, then whatever a student's program may do; `FOLDER` has the example `external_control`. A
program that has lost control takes it again.
"""

import sys
import time
from collections.abc import Callable
from typing import Any, Final

SOUND_S: Final = 1.0
PATIENCE_S: Final = 0.3  # the own controller flies after so long a silence
Task = dict[str, Any]


def stick(task: Task, *shares: float) -> list[float]:
    """Input with sticks pushed towards their limits by shares of the way."""
    return [
        hover + share * ((high if share > 0.0 else hover) - (hover if share > 0.0 else low))
        for hover, low, high, share in zip(
            task["hover_input"], task["input_min"], task["input_max"], shares, strict=True
        )
    ]


def side(period_s: float) -> float:
    """1 and -1 in turns."""
    return 1.0 if time.monotonic() % period_s < period_s / 2 else -1.0


def late(control: Any, task: Task) -> None:
    time.sleep(0.2)
    control.answer(task, [stick(task, 0.3, 0.3, 0.0, 0.0)])


def flooding(control: Any, task: Task) -> None:
    until_s = time.monotonic() + 0.1
    while time.monotonic() < until_s:
        control.answer(task, [stick(task, 0.0, 0.0, 0.0, 0.0)] * 50)


def hanging(*_: object) -> None:
    time.sleep(3600.0)


def raising(*_: object) -> None:
    raise RuntimeError("a table is missing")


def pushing(sticks: Callable[[], tuple[float, ...]], rows: int = 50) -> Callable[[Any, Task], None]:
    """Answer in time with sticks of one's own, planned for a second."""
    return lambda control, task: control.answer(task, [stick(task, *sticks())] * rows)


DEEDS: Final[dict[str, Callable[[Any, Task], None]]] = {
    "late": late,
    "silent": lambda *_: None,
    "not_finite": lambda control, task: control.answer(task, [[float("nan")] * 4]),
    "beyond_limits": lambda control, task: control.answer(task, [[9.0] * 4]),
    "dives": pushing(lambda: (0.0, 0.0, -1.0, 0.0)),
    "climbs": pushing(lambda: (0.0, 0.0, 1.0, 0.0)),
    "flees": pushing(lambda: (-1.0, 1.0, 0.0, 0.0)),
    "attacks": pushing(lambda: (1.0, -1.0, 0.0, 0.0)),
    "oscillating": pushing(lambda: (side(0.5), side(0.5), side(1.0), side(0.3)), rows=1),
    "flooding": flooding,
    "hanging": hanging,
    "raising": raising,
}


def main(kind: str, folder: str, fleet: str, vehicle: str, router: str, namespace: str) -> None:
    """Fly until the end of the process."""
    sys.path.insert(0, folder)
    from external_control import ExternalControl  # type: ignore[import-not-found]  # an example
    from fly import feedback  # type: ignore[import-not-found]  # an example

    control = ExternalControl(fleet, vehicle, "hostile", router, namespace)
    while True:
        try:
            control.take(PATIENCE_S)
            sound_until_s = time.monotonic() + SOUND_S
            while True:
                task = control.next_task()
                if time.monotonic() < sound_until_s:
                    control.answer(task, [feedback(task)])
                else:
                    DEEDS[kind](control, task)
        except (TimeoutError, RuntimeError) as error:
            print(error, file=sys.stderr)
            if kind == "raising" and "table" in str(error):
                raise
            time.sleep(0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
