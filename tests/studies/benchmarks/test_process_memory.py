"""Promises about processes and their memory: grandchildren count, strangers do not, shared pages once."""

import os
import subprocess
import sys

import pytest

from rcopterx_studies.benchmarks.processes import cpu_s, descendants, memory_of

WAITS = "import sys; sys.stdin.read()"
STARTS_ANOTHER = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {WAITS!r}])"


def test_grandchildren_count_and_strangers_do_not() -> None:
    with subprocess.Popen([sys.executable, "-c", STARTS_ANOTHER], stdin=subprocess.PIPE) as child:
        found = list[int]()
        while len(found) < 2:
            found = descendants(os.getpid())
        assert child.pid in found
        assert os.getppid() not in found
        assert child.stdin is not None
        child.stdin.close()


def test_this_process_is_a_descendant_of_its_parent() -> None:
    assert os.getpid() in descendants(os.getppid())
    assert memory_of([os.getpid()]) > 1.0
    assert cpu_s(os.getpid()) > 0.0


def test_a_process_that_has_ended_has_no_memory() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
        assert memory_of([os.getpid(), child.pid]) == pytest.approx(memory_of([os.getpid()]), rel=0.1)
