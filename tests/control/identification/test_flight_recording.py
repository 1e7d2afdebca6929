"""Recordings survive the file, bridge short gaps, and say what is wrong with them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rcopterx.control.identification.recording import (
    FlightLog,
    FlightRecording,
    RecordingError,
    load_recording,
)
from rcopterx.control.interfaces import Measurement


def recording(rows: int = 50) -> FlightRecording:
    ramp = np.linspace(0.0, 1.0, rows)
    return FlightRecording(
        "coaxial",
        0.02,
        np.outer(ramp, [1.0, 2.0, 3.0]),
        ramp,
        np.outer(ramp, [0.1, 0.2]),
        np.outer(ramp, np.ones(4)),
    )


def pose(row: int, tilt: bool = True) -> Measurement:
    return Measurement(np.full(3, 0.1 * row), 0.01 * row, np.full(2, 0.001 * row) if tilt else None)


def log_of(rows: list[int], tilt: bool = True) -> FlightLog:
    log = FlightLog("coaxial", 0.02)
    for row in rows:
        log.add_pose(row, pose(row, tilt))
        log.add_input(row, np.full(4, float(row)))
    return log


def test_a_file_gives_back_what_was_saved(tmp_path: Path) -> None:
    saved = recording()
    saved.save(tmp_path / "flight.npz")
    loaded = load_recording(tmp_path / "flight.npz")
    assert loaded.kind == "coaxial"
    assert loaded.period_s == 0.02
    for name in ("position_m", "yaw_rad", "tilt", "inputs"):
        assert (getattr(loaded, name) == getattr(saved, name)).all()


def test_a_file_without_tilt_has_none(tmp_path: Path) -> None:
    replace(recording(), tilt=None).save(tmp_path / "flight.npz")
    assert load_recording(tmp_path / "flight.npz").tilt is None


def test_files_that_are_no_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no recording of a flight"):
        load_recording(tmp_path / "missing.npz")
    (tmp_path / "text.npz").write_text("no archive")
    with pytest.raises(RecordingError, match="no recording of a flight"):
        load_recording(tmp_path / "text.npz")
    np.savez(tmp_path / "other.npz", yaw_rad=np.zeros(3))
    with pytest.raises(RecordingError, match="without format, inputs"):
        load_recording(tmp_path / "other.npz")


def without_its_end(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def with_a_flipped_bit(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def as_an_array_alone(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.zeros(3))


def with_entry(name: str, value: object) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        with np.load(path) as stored:
            entries = {**stored, name: value}
        np.savez(path, **entries)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (without_its_end, "no recording of a flight"),
        (with_a_flipped_bit, "no recording of a flight"),
        (as_an_array_alone, "no recording of a flight"),
        (with_entry("yaw_rad", np.full(50, "north")), "no recording of a flight.*north"),
        (with_entry("format", np.ones(2)), r"format \[1. 1.\], this version reads 1"),
    ],
)
def test_broken_files_are_refused_by_their_name(
    tmp_path: Path, spoil: Callable[[Path], None], words: str
) -> None:
    path = tmp_path / "flight.npz"
    recording().save(path)
    spoil(path)
    with pytest.raises(RecordingError, match=rf"flight\.npz: {words}"):
        load_recording(path)


def test_rows_that_do_not_fit_or_are_not_finite_are_refused() -> None:
    good = recording()
    with pytest.raises(RecordingError, match="inputs: shape"):
        FlightRecording("coaxial", 0.02, good.position_m, good.yaw_rad, None, good.inputs[:-1])
    with pytest.raises(RecordingError, match="yaw_rad: not all numbers are finite"):
        FlightRecording("coaxial", 0.02, good.position_m, good.yaw_rad * np.nan, None, good.inputs)


def test_short_gaps_are_bridged() -> None:
    known = [row for row in range(30) if row not in (10, 11, 12)]
    found = log_of(known).recording()
    assert len(found.yaw_rad) == 30
    assert found.position_m[11, 0] == pytest.approx(1.1)
    assert found.tilt is not None
    assert found.tilt[11, 0] == pytest.approx(0.011)
    assert found.inputs[11, 0] == 9.0, "sticks are held"


def test_long_gaps_are_refused() -> None:
    known = [row for row in range(60) if not 10 <= row < 20]
    with pytest.raises(RecordingError, match=r"poses are missing for 0.20 s"):
        log_of(known).recording()


def test_nothing_recorded_is_refused() -> None:
    with pytest.raises(RecordingError, match="nothing was recorded"):
        FlightLog("coaxial", 0.02).recording()


def test_turns_are_counted_across_the_wrap() -> None:
    log = FlightLog("coaxial", 0.02)
    for row in range(400):
        yaw_rad = float(np.angle(np.exp(1j * 0.05 * row)))
        log.add_pose(row, Measurement(np.zeros(3), yaw_rad))
        log.add_input(row, np.zeros(4))
    found = log.recording()
    assert found.yaw_rad[-1] == pytest.approx(0.05 * 399)
    assert found.tilt is None
