"""Promises of the heartbeat: the supervisor sees what the loop of another process counts."""

import os
import subprocess
import sys

from rcopterx.bus.heartbeat import VARIABLE, HeartbeatPage, LoopPhase, own_heartbeat

PROGRAM = """
import os, sys
from rcopterx.bus.heartbeat import VARIABLE, own_heartbeat
heartbeat = own_heartbeat()
assert own_heartbeat() is heartbeat
assert VARIABLE not in os.environ
for line in sys.stdin:
    eval(line)
    print("done", flush=True)
"""


def test_a_supervisor_sees_the_beats_and_the_phase_of_a_process() -> None:
    page = HeartbeatPage()
    assert (page.beats, page.phase) == (0, LoopPhase.STARTING)
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=[page.descriptor],
        env={VARIABLE: str(page.descriptor), "PYTHONPATH": ":".join(sys.path)},
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        page.handed_over()
        for line, beats, phase in (
            ("heartbeat.beat()", 1, LoopPhase.WORKING),
            ("heartbeat.beat(flying=True)", 2, LoopPhase.FLYING),
            ("heartbeat.starting()", 2, LoopPhase.STARTING),
            ("heartbeat.beat()", 3, LoopPhase.WORKING),
            ("heartbeat.ending()", 3, LoopPhase.ENDING),
        ):
            process.stdin.write(line + "\n")
            process.stdin.flush()
            assert process.stdout.readline() == "done\n"
            assert (page.beats, page.phase) == (beats, phase)
        process.stdin.close()
        assert process.wait(60) == 0
    assert (page.beats, page.phase) == (3, LoopPhase.ENDING)


def test_a_process_without_a_supervisor_may_beat() -> None:
    own_heartbeat().beat()


def test_a_phase_that_does_not_exist_asks_for_patience() -> None:
    page = HeartbeatPage()
    os.pwrite(page.descriptor, (17).to_bytes(8, sys.byteorder), 8)
    page.handed_over()
    assert page.phase is LoopPhase.STARTING
