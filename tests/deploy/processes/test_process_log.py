"""Promises of the logs of processes: one line per event, kept within bounds, read merged in time."""

import errno
import io
import logging
import os
import re
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Event

import pytest
from support.waiting import wait_for

from rcopterx.bus.codec import decode, encode
from rcopterx.bus.requests import MAX_LINE, MAX_LINES, LoggedLine, ReadLogs, ReadLogsReply
from rcopterx.deploy.processes import process_log
from rcopterx.deploy.processes.log_reading import PAGE_BYTES, ProcessLogs, read_page
from rcopterx.deploy.processes.process_log import (
    MOST_WAITING,
    LauncherLog,
    QueueingHandler,
    rotate,
)

LINES = 20_000
UNREAD = f"""
import logging
from rcopterx.deploy.processes.process_log import set_up
set_up()
for number in range({LINES}):
    logging.warning("line %d", number)
print("end", flush=True)
"""
CODE = """
import logging
from rcopterx.deploy.processes.process_log import set_up
set_up()
logging.info("agent %s: started", "h1")
logging.warning("all is lost")
raise ValueError("no way")
"""


def logged(**environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | environment,
        check=False,
    )
    return done.stderr.splitlines()


def test_supervised_processes_log_with_times_and_others_only_what_is_wrong() -> None:
    lines = logged(RCOPTERX_PARENT="1")
    assert [line[23:] for line in lines[:3]] == [
        "Z INFO agent h1: started", "Z WARNING all is lost", "Z CRITICAL ends by ValueError: no way",
    ]  # fmt: skip
    assert "Traceback" in lines[3]
    assert logged()[:2] == ["all is lost", "ends by ValueError: no way"]


def test_a_process_whose_log_nothing_reads_goes_on_and_ends() -> None:
    reading, writing = os.pipe()
    try:
        done = subprocess.run(
            [sys.executable, "-c", UNREAD],
            stdout=subprocess.PIPE,
            stderr=writing,
            text=True,
            timeout=300,
            check=False,
        )
        assert (done.returncode, done.stdout) == (0, "end\n")
    finally:
        os.close(reading)
        os.close(writing)


def test_lines_that_are_dropped_are_counted_in_the_log() -> None:
    written = io.StringIO()
    held = HeldStream(written)
    handler = QueueingHandler(held)
    for number in range(2 * MOST_WAITING):
        handler.handle(logging.makeLogRecord({"msg": str(number)}))
    held.released.set()
    wait_for(lambda: str(MOST_WAITING - 1) in written.getvalue(), "the lines are not written")
    handler.handle(logging.makeLogRecord({"msg": "last"}))
    handler.close()
    first, *_, counted, last = written.getvalue().splitlines()
    assert (first, last) == ("0", "last")
    assert re.fullmatch(r"\d+ lines were dropped here", counted)


class HeldStream(io.StringIO):
    """Passes what is written on once it is released."""

    def __init__(self, target: io.StringIO) -> None:
        super().__init__()
        self._target = target
        self.released = Event()

    def write(self, text: str) -> int:
        self.released.wait(60.0)
        return self._target.write(text)


def test_a_launcher_logs_in_a_thread_and_its_last_lines_are_written(tmp_path: Path) -> None:
    log = LauncherLog(tmp_path)
    log.append(["agent-h1: killed by SIGKILL"])
    log.append(["agent-h1: started again"])
    log.close()
    assert [line.text for line in ProcessLogs(tmp_path).new_lines()] == [
        "INFO agent-h1: killed by SIGKILL",
        "INFO agent-h1: started again",
    ]


def test_lines_of_a_launcher_have_the_time_of_their_event_when_the_disk_writes_them_later(
    tmp_path: Path,
) -> None:
    blocked = tmp_path / "launcher.log"
    os.mkfifo(blocked)
    log = LauncherLog(tmp_path)
    log.append(["agent-h1: killed by SIGKILL"])
    log.append(["agent-h1: started again"])
    after = datetime.now(UTC)
    wait_for(lambda: datetime.now(UTC) - after > timedelta(seconds=0.05), "the time stands still")
    # Also a writer, so that the file does not end between two lines.
    with os.fdopen(os.open(blocked, os.O_RDWR), "r") as reader:
        written = [reader.readline(), reader.readline()]
    log.close()
    assert all(datetime.fromisoformat(line.split()[0]) <= after for line in written)


@pytest.mark.usefixtures("small_logs")
def test_a_launcher_puts_large_logs_aside(tmp_path: Path) -> None:
    (tmp_path / "tracker.log").write_text("x" * 101)
    log = LauncherLog(tmp_path)
    wait_for(lambda: not (tmp_path / "tracker.log").stat().st_size, "the log stays")
    log.close()
    assert (tmp_path / "tracker.log.1").read_text() == "x" * 101


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    (tmp_path / "agent-h2.log").write_text(
        "2026-11-22T03:00:01.000Z INFO started\n2026-11-22T03:00:03.000Z CRITICAL ends\nTraceback\n  line 1\n"
    )
    (tmp_path / "tracker.log").write_text("2026-11-22T03:00:02.500Z WARNING stands by\nhalf a li")
    (tmp_path / "agent-h2.log.1").write_text("2026-11-22T02:00:00.000Z INFO old\n")
    return tmp_path


def test_logs_are_merged_in_time_and_tracebacks_stay_together(directory: Path) -> None:
    lines = ProcessLogs(directory).new_lines()
    assert [(line.process, line.text) for line in lines] == [
        ("agent-h2", "INFO old"),
        ("agent-h2", "INFO started"),
        ("tracker", "WARNING stands by"),
        ("agent-h2", "CRITICAL ends"),
        ("agent-h2", "Traceback"),
        ("agent-h2", "  line 1"),
    ]
    assert lines[-1].time == "2026-11-22T03:00:03.000Z"


def test_only_new_and_whole_lines_come_the_next_time(directory: Path) -> None:
    logs = ProcessLogs(directory, ["tracker"])
    assert len(logs.new_lines()) == 1
    assert logs.new_lines() == []
    with (directory / "tracker.log").open("a") as file:
        file.write("ne\n")
    assert [line.text for line in logs.new_lines()] == ["half a line"]
    (directory / "tracker.log").write_text("2026-11-22T03:01:00.000Z INFO anew\n")
    assert [line.text for line in logs.new_lines()] == ["INFO anew"]


def test_logs_are_chosen_by_process_or_vehicle(directory: Path) -> None:
    for name in ("h2", "agent-h2"):
        assert {line.process for line in ProcessLogs(directory, [name]).new_lines()} == {"agent-h2"}
    assert ProcessLogs(directory).processes() == ["agent-h2", "tracker"]
    assert ProcessLogs(directory / "absent").new_lines() == []


@pytest.fixture
def small_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_log, "LARGEST_BYTES", 100)


@pytest.mark.usefixtures("small_logs")
def test_a_large_log_is_put_aside_while_its_process_writes_and_a_small_one_left(tmp_path: Path) -> None:
    (tmp_path / "tracker.log").write_text("little")
    with (tmp_path / "router.log").open("a") as file:
        file.write("x" * 101)
        file.flush()
        rotate(tmp_path)
        file.write("later")
    assert (tmp_path / "router.log").read_text() == "later"
    assert (tmp_path / "router.log.1").read_text() == "x" * 101
    assert (tmp_path / "tracker.log").read_text() == "little"
    assert not (tmp_path / "tracker.log.1").exists()


@pytest.mark.usefixtures("small_logs")
def test_a_log_stays_when_the_disk_is_too_full_to_put_it_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("shutil.copyfile", fail)
    (tmp_path / "router.log").write_text("x" * 101)
    rotate(tmp_path)
    assert (tmp_path / "router.log").read_text() == "x" * 101


@pytest.mark.usefixtures("small_logs")
def test_every_line_is_read_once_while_logs_are_put_aside(tmp_path: Path) -> None:
    logs = ProcessLogs(tmp_path)
    read: list[str] = []
    for number in range(40):
        with (tmp_path / "router.log").open("a") as file:
            file.write(f"2026-11-22T03:00:04.000Z INFO {number}\n")
        if number % 7 == 0:
            rotate(tmp_path)
        if number % 3 == 0:
            read += [line.text for line in logs.new_lines()]
    read += [line.text for line in logs.new_lines()]
    assert read == [f"INFO {number}" for number in range(40)]


def test_events_of_a_launcher_are_logged_with_their_time_and_a_full_disk_is_ignored(tmp_path: Path) -> None:
    for directory in (tmp_path, tmp_path / "nowhere"):
        log = LauncherLog(directory)
        log.append(["agent-h1: killed by SIGKILL"])
        log.close()
    (line,) = ProcessLogs(tmp_path).new_lines()
    assert (line.process, line.text) == ("launcher", "INFO agent-h1: killed by SIGKILL")
    assert len(line.time) == 24


def sent_pages(directory: Path, *names: str) -> list[ReadLogsReply]:
    """Everything a host has logged, as it is requested and sent on the bus."""
    pages, positions = [], dict[str, int]()
    while not pages or pages[-1].more:
        assert len(pages) < 100
        answer = encode(read_page(directory, ReadLogs(names=names, positions=positions)))
        pages.append(decode(answer, ReadLogsReply))
        positions = pages[-1].positions
    return pages


def test_a_host_answers_with_its_logs_in_pages_of_limited_size(directory: Path) -> None:
    texts = [f"INFO line {number}" for number in range(3 * MAX_LINES)]
    (directory / "router.log").write_text("".join(f"2026-11-22T03:00:04.000Z {text}\n" for text in texts))
    pages = sent_pages(directory)
    lines = [line for page in pages for line in page.lines]
    assert max(len(page.lines) for page in pages) <= MAX_LINES
    assert [line.text for line in lines if line.process == "router"] == texts
    assert LoggedLine("2026-11-22T03:00:03.000Z", "agent-h2", "  line 1") in lines
    again = read_page(directory, ReadLogs(positions=pages[-1].positions))
    assert (again.lines, again.more) == ((), False)
    assert {line.process for page in sent_pages(directory, "h2") for line in page.lines} == {"agent-h2"}


def test_a_line_that_fits_into_no_answer_is_cut_and_bytes_that_are_no_text_do_no_harm(
    directory: Path,
) -> None:
    (directory / "router.log").write_bytes(b"\xff" * (3 * PAGE_BYTES) + b"\nlast\n")
    texts = [line.text for page in sent_pages(directory, "router") for line in page.lines]
    assert {len(text) for text in texts[:-2]} == {MAX_LINE}
    assert texts[-1] == "last"
