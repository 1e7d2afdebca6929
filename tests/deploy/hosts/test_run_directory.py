"""The run directory of a fleet belongs to its user, and no other user can read it."""

import os
import stat
import time
from pathlib import Path

import pytest

from rcopterx.bus.clock import Clock
from rcopterx.deploy.hosts.run_directory import (
    Begun,
    check_owner,
    read_flight,
    run_directory,
    write_flight,
)


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "run"))
    return tmp_path / "run"


def test_only_the_owner_reaches_the_sockets_in_a_run_directory(base: Path) -> None:
    base.mkdir(mode=0o755)
    (base / "lab").mkdir(mode=0o777)
    path = run_directory("lab", None)
    assert stat.S_IMODE(path.stat().st_mode) == 0o700
    assert (path / "log").is_dir()


def test_a_link_in_the_place_of_the_run_directory_is_refused(base: Path, tmp_path: Path) -> None:
    base.mkdir()
    (tmp_path / "elsewhere").mkdir()
    (base / "lab").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match=r"run directory .*lab is a link or a file; set RCOPTERX_RUN"):
        run_directory("lab", None)
    assert not (tmp_path / "elsewhere" / "log").exists()


def test_a_directory_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    if tmp_path.stat().st_uid == 0:
        # Only root can have put there what belongs to root.
        check_owner(tmp_path)
        os.chown(tmp_path, 12345, -1)
    with pytest.raises(OSError, match="belongs to another user"):
        check_owner(tmp_path)


def test_a_restarted_recorder_continues_the_times_of_its_flight(tmp_path: Path) -> None:
    path, clock = tmp_path / "flight-main.txt", Clock(0.2)
    before_ns = time.time_ns()
    flight = Begun.now("trio-20261122-141500", clock)
    write_flight(path, flight)
    assert read_flight(path) == flight
    assert before_ns - 10**7 <= flight.zero_ns + clock.now() * 1e9 <= time.time_ns() + 10**7


@pytest.mark.parametrize("content", [None, "", "trio", "trio x"])
def test_without_a_launcher_no_flight_is_under_way(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / "flight-main.txt"
    if content is not None:
        path.write_text(content)
    assert read_flight(path) is None
