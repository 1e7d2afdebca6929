"""Programs that take processors end in time."""

import os
import resource
import time
from types import SimpleNamespace

import pytest

from rcopterx_studies.faults import load
from rcopterx_studies.faults.load import spinning_once


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
