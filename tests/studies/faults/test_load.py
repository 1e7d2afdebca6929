"""Programs that take processors end in time."""

import os
import resource
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from rcopterx_studies.faults import load
from rcopterx_studies.faults.load import loaded, spinning_once


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


def test_two_programs_that_take_one_processor_do_not_take_it_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Both are ordered at the same time; the second one gets no processor before its time is over.
    ordered_s, processors = time.monotonic(), os.sched_getaffinity(0)
    monkeypatch.setattr(load, "time", SimpleNamespace(monotonic=lambda: ordered_s))
    before_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    processor = min(processors)
    os.sched_setaffinity(0, {processor})
    try:
        with spinning_once(0.3, processor), spinning_once(0.3, processor):
            pass
    finally:
        os.sched_setaffinity(0, processors)
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before_s < 0.5
