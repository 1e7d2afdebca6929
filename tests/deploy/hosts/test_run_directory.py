"""The run directory of a fleet belongs to its user, and no other user can read it."""

import os
import stat
from pathlib import Path

import pytest

from rcopterx.deploy.hosts.run_directory import check_owner, run_directory


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
