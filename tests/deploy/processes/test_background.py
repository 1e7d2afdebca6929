"""Promises of programs in the background: they let others pass, and Ctrl-C does not end them."""

import os
import sys
from pathlib import Path

import pytest
from support.waiting import wait_for

from rcopterx.ground_station.terminal.margin_warnings import NICE, start_in_background

ECHO = "import os, sys; text = sys.stdin.read(); print(text, os.getsid(0) == os.getpid())"


def test_a_program_has_pipes_and_a_session_of_its_own() -> None:
    with start_in_background([sys.executable, "-c", ECHO]) as process:
        output, complaint = process.communicate(b"hello")
    assert (output.decode().split(), complaint, process.returncode) == (["hello", "True"], b"", 0)


def test_a_program_gets_what_others_leave_it() -> None:
    with start_in_background([sys.executable, "-c", ECHO]) as process:
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == NICE
        process.communicate(b"")


@pytest.mark.skipif(not Path("/proc/self/autogroup").exists(), reason="this kernel knows no autogroups")
def test_sessions_of_others_come_first_where_the_kernel_shares_by_session() -> None:
    def group() -> str:
        with start_in_background([sys.executable, "-c", ECHO]) as process:
            content = Path(f"/proc/{process.pid}/autogroup").read_text(encoding="ascii")
            process.communicate(b"")
        return content.split()[-1]

    # The kernel grants it to those without privileges ten times a second at most.
    wait_for(lambda: group() == str(NICE), "the session is not set back")
