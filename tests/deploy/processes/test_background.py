"""Promises of programs that nobody waits for: they let others pass, and Ctrl-C is not for them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.waiting import wait_for

from rcopterx.deploy.processes.background import NICE, begun_behind_others

ECHO = "import os, sys; told = sys.stdin.read(); print(told, os.getsid(0) == os.getpid())"


def test_a_program_is_told_and_tells_in_a_session_of_its_own() -> None:
    with begun_behind_others([sys.executable, "-c", ECHO]) as process:
        output, complaint = process.communicate(b"hello")
    assert (output.decode().split(), complaint, process.returncode) == (["hello", "True"], b"", 0)


def test_a_program_gets_what_others_leave_it() -> None:
    with begun_behind_others([sys.executable, "-c", ECHO]) as process:
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == NICE
        process.communicate(b"")


def test_a_process_steps_behind_others_itself() -> None:
    script = (
        "import os; from rcopterx.deploy.processes.background import step_behind_others;"
        "step_behind_others();"
        "print(os.getpriority(os.PRIO_PROCESS, 0))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert int(done.stdout) == NICE


@pytest.mark.skipif(not Path("/proc/self/autogroup").exists(), reason="this kernel knows no autogroups")
def test_sessions_of_others_come_first_where_the_kernel_shares_by_session() -> None:
    def group() -> str:
        with begun_behind_others([sys.executable, "-c", ECHO]) as process:
            told = Path(f"/proc/{process.pid}/autogroup").read_text(encoding="ascii")
            process.communicate(b"")
        return told.split()[-1]

    # The kernel grants it to those without privileges ten times a second at most.
    wait_for(lambda: group() == str(NICE), "the session is not set back")
