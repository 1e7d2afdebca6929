"""Promises of the file behind a recording: nothing is overwritten, nothing waits for the disk."""

import io
import threading
from contextlib import closing
from pathlib import Path

import pytest
from support.waiting import wait_for

from rcopterx.vicon_gateway import recording
from rcopterx.vicon_gateway.recording import RecordingFile, RecordingFileError, check_creatable


def test_what_was_written_is_in_the_file_without_closing_it(tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    with closing(RecordingFile.create(path)) as file:
        file.write(b"abc")
        file.write(b"defg")
        wait_for(lambda: path.read_bytes() == b"abcdefg", "not written")
        file.write(b"h")
    assert path.read_bytes() == b"abcdefgh"


def test_earlier_recordings_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    for number in range(3):
        with closing(RecordingFile.create(path)) as file:
            file.write(bytes([number]))
    found = {
        name: (tmp_path / name).read_bytes() for name in ("session.raw", "session-2.raw", "session-3.raw")
    }
    assert found == {"session.raw": b"\0", "session-2.raw": b"\1", "session-3.raw": b"\2"}
    assert file.path == tmp_path / "session-3.raw"


@pytest.mark.parametrize(
    ("name", "reason"),
    [("nowhere/session.raw", "No such file or directory"), ("", "is a directory, a file is needed")],
)
def test_file_that_cannot_be_created_is_named_with_the_reason(name: str, reason: str, tmp_path: Path) -> None:
    for create in (RecordingFile.create, check_creatable):
        with pytest.raises(RecordingFileError, match=rf"^{tmp_path / name}.* {reason}$"):
            create(tmp_path / name)


def test_checking_leaves_nothing_behind(tmp_path: Path) -> None:
    check_creatable(tmp_path / "session.raw")
    assert list(tmp_path.iterdir()) == []


def test_full_disk_is_told_by_a_later_write(tmp_path: Path) -> None:
    class FullDisk(io.BytesIO):
        def write(self, data: object) -> int:
            raise OSError(28, "No space left on device")

    def refused() -> bool:
        try:
            file.write(b"abc")
        except OSError as error:
            return "No space left" in str(error)
        return False

    with closing(RecordingFile(FullDisk(), tmp_path)) as file:
        wait_for(refused, "the full disk is not told")


def test_disk_that_hangs_delays_nobody_and_ends_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "MAX_WAITING_BYTES", 100)
    released = threading.Event()

    class HangingDisk(io.BytesIO):
        def write(self, data: object) -> int:
            released.wait()
            return 0

    with closing(RecordingFile(HangingDisk(), tmp_path)) as file:
        file.write(bytes(60))
        with pytest.raises(OSError, match="is 100 bytes behind"):
            file.write(bytes(60))
        released.set()
