"""CSV files become recordings of the same flight, and say where they are wrong."""

import gzip
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.flight_csv import FULL, rows_of, write_csv

from rcopterx.control.identification.recording import FlightRecording, RecordingError
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx_studies.experiments.flight_csv import is_csv, read_columns, read_flight, read_mapped

Rows = list[dict[str, float]]


def flight(rows: int = 60) -> FlightRecording:
    time_s = 0.02 * np.arange(rows)
    ramp = np.linspace(0.0, 1.0, rows)
    return FlightRecording(
        "crazyflie",
        0.02,
        np.column_stack((np.sin(time_s), ramp, 1.0 + 0.1 * ramp)),
        0.5 + 3.0 * ramp,
        np.column_stack((0.2 * np.sin(4 * time_s), 0.1 * ramp)),
        np.column_stack((0.3 * ramp, -0.2 * ramp, 0.6 + 0.1 * ramp, np.full(rows, 0.4))),
        4.0 - 0.5 * ramp,
    )


@pytest.mark.parametrize("compressed", [False, True])
def test_a_file_is_read_as_the_flight_above_the_floor(tmp_path: Path, compressed: bool) -> None:
    known = flight()
    path = write_csv(tmp_path / "flight.csv", rows_of(known))
    if compressed:
        text = path.read_bytes()
        path = tmp_path / "flight.csv.gz"
        path.write_bytes(gzip.compress(text))
    found = read_flight(path, "crazyflie", FULL)
    rows = len(found.yaw_rad)
    assert (found.period_s, found.logged) == (0.02, True)
    assert rows >= len(known.yaw_rad) - 1
    assert found.tilt is not None
    assert known.tilt is not None
    np.testing.assert_allclose(found.position_m, known.position_m[:rows], atol=1e-5)
    # The file leans a vehicle that has turned, which turns it by a little more.
    np.testing.assert_allclose(found.yaw_rad, known.yaw_rad[:rows], atol=0.02)
    np.testing.assert_allclose(found.tilt, known.tilt[:rows], atol=1e-5)
    np.testing.assert_allclose(found.inputs, known.inputs[:rows], atol=1e-4)
    assert found.battery_v == pytest.approx(known.battery_v[:rows], abs=1e-5)


def test_short_gaps_are_bridged(tmp_path: Path) -> None:
    rows = rows_of(flight())
    found = read_flight(write_csv(tmp_path / "a.csv", rows[:40] + rows[43:]), "crazyflie", FULL)
    np.testing.assert_allclose(found.position_m, flight().position_m[: len(found.yaw_rad)], atol=1e-3)


def test_poses_of_a_fast_tracker_are_thinned_out(tmp_path: Path) -> None:
    rows = [{**row, "t": row["t"] / 4} for row in rows_of(flight())]
    found = read_flight(write_csv(tmp_path / "a.csv", rows), "crazyflie", FULL)
    assert found.period_s == 0.02
    np.testing.assert_allclose(found.position_m, flight().position_m[::4][: len(found.yaw_rad)], atol=1e-4)


def with_value(column: str, value: float) -> Callable[[Rows], Rows]:
    def changed(rows: Rows) -> Rows:
        return [*rows[:30], {**rows[30], column: value}, *rows[31:]]

    return changed


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (with_value("px", float("nan")), "line 32, column px: 'nan' is not a number"),
        (with_value("qw", 3.0), "not a unit quaternion"),
        (with_value("t", 0.0), "line 32: time does not increase"),
        (lambda rows: rows[:30] + rows[35:], "line 32: poses are missing, 0.120 s since the line before"),
        (lambda rows: rows[:10], "nothing flies"),
        (lambda _: [], "nothing flies"),
    ],
)
def test_files_with_flaws_are_refused(tmp_path: Path, spoil: Callable[[Rows], Rows], words: str) -> None:
    path = write_csv(tmp_path / "flight.csv", spoil(rows_of(flight())))
    with pytest.raises(RecordingError, match=words) as refused:
        read_flight(path, "crazyflie", FULL)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"t,px\n1,2\n", "no column py, pz, qx"),
        (b"", "no column t, px"),
        (b"t,px\n\xff", "not UTF-8 text"),
        (b"not compressed", "Not a gzipped file"),
    ],
)
def test_files_of_another_kind_are_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / ("flight.csv.gz" if b"compressed" in content else "flight.csv")
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        read_flight(path, "crazyflie", FULL)


def test_a_compressed_file_with_a_flipped_bit_is_refused(tmp_path: Path) -> None:
    content = bytearray(gzip.compress(write_csv(tmp_path / "flight.csv", rows_of(flight())).read_bytes()))
    content[10] ^= 2  # type of the first block, after the header of gzip
    path = tmp_path / "flight.csv.gz"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"flight\.csv\.gz"):
        read_flight(path, "crazyflie", FULL)


def test_lines_of_another_length_are_refused(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "flight.csv", rows_of(flight()))
    path.write_text(path.read_text() + "1,2\n")
    with pytest.raises(RecordingError, match="2 values instead of 14"):
        read_flight(path, "crazyflie", FULL)


def test_a_missing_file_is_an_error_of_recordings(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.csv"):
        read_flight(tmp_path / "none.csv", "crazyflie", FULL)


def test_names_show_csv_files() -> None:
    assert is_csv(Path("a.csv"))
    assert is_csv(Path("a.csv.gz"))
    assert not is_csv(Path("a.npz"))


def test_voltages_belong_to_rows() -> None:
    with pytest.raises(RecordingError, match="battery_v"):
        replace(flight(), battery_v=np.zeros(3))


MAP = """
pitch = {{ pid_controller_pitch = {share:.9f} }}
roll = {{ pid_controller_roll = {share:.9f} }}
thrust = {{ pid_controller_cmd_thrust = {thrust:.9f}, pid_controller_pitch = 0.0 }}
from_s = 1700000000.595
until_s = 1700000001.395
"""


def mapped(directory: Path, rows: Rows, text: str = MAP) -> FlightRecording:
    columns = directory / "columns.toml"
    columns.write_text(text.format(share=-1.0 / FULL.full_tilt_deg, thrust=1.0 / FULL_THRUST))
    return read_mapped(write_csv(directory / "flight.csv", rows), "coaxial", read_columns(columns))


def test_a_map_names_columns_and_times_of_any_vehicle(tmp_path: Path) -> None:
    rows = rows_of(flight())
    spiked = [*rows[:60], {**rows[60], "pid_controller_pitch": 500.0}, *rows[61:]]
    found, whole = mapped(tmp_path, spiked), mapped(tmp_path, rows, MAP.partition("from_s")[0])
    begin = 30
    assert len(found.yaw_rad) == pytest.approx(0.8 / 0.02, abs=1)
    assert (found.kind, found.logged) == ("coaxial", False)
    shown = slice(begin, begin + len(found.yaw_rad))
    np.testing.assert_allclose(found.position_m, whole.position_m[shown], atol=1e-6)
    np.testing.assert_allclose(found.inputs[:-3], whole.inputs[shown][:-3], atol=0.01)
    np.testing.assert_allclose(found.inputs[:, 3], 0.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pitch = {{ a = 1.0 }}", "columns.toml: .*roll"),
        ("pitch = 3", "columns.toml: Expected `object`"),
        ("pitch = ", "columns.toml: Invalid value"),
        (MAP.replace("cmd_thrust", "cmd"), "no column pid_controller_cmd"),
        (MAP.replace("until_s = 1700000001.395", "until_s = 1.0"), "fewer than two rows"),
    ],
)
def test_maps_that_do_not_fit_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        mapped(tmp_path, rows_of(flight()), text)
