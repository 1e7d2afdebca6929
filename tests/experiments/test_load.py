"""Programs that take processors end in time."""

import os
import resource
import threading
from pathlib import Path

from rcopterx.experiments.faults.load import loaded, spinning_once


def test_programs_that_spin_end_with_the_load() -> None:
    shown: list[str] = []
    before = children_of_this_process()
    with loaded(2, shown.append):
        children = children_of_this_process() - before
        assert len(children) == 2 + len(os.sched_getaffinity(0))
    assert not shown or "no permission" in shown[0]
    assert not children & children_of_this_process()
    with loaded(0, shown.append):
        assert children_of_this_process() <= before


def children_of_this_process() -> set[str]:
    return set(
        Path(f"/proc/{os.getpid()}/task/{threading.main_thread().native_id}/children").read_text().split()
    )


def test_two_programs_that_take_one_processor_do_not_take_it_one_after_the_other() -> None:
    processor = min(os.sched_getaffinity(0))
    before_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with spinning_once(0.3, processor), spinning_once(0.3, processor):
        pass
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before_s < 0.5
