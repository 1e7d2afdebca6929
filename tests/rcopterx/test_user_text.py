"""Promises of texts of users: they read the same, whatever program has written them."""

import codecs
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.user_text import Row, TextError, decoded, described, host_and_port, number_in, rows_of, similar

SHIPPED = ("duo", "trio", "crazyflies")
TABLE = "t,x\n0,1.5\n3,ü\n"
ROWS = [Row(1, ["t", "x"]), Row(2, ["0", "1.5"]), Row(3, ["3", "ü"])]


@pytest.mark.parametrize(
    "data",
    [
        TABLE.encode(),
        codecs.BOM_UTF8 + TABLE.encode(),
        TABLE.replace("\n", "\r\n").encode(),
        TABLE.replace("\n", "\r").encode(),
        TABLE.encode("utf-16"),
        codecs.BOM_UTF16_BE + TABLE.encode("utf-16-be"),
        TABLE.replace(",", ";").encode(),
        TABLE.replace(",", "\t").encode(),
        TABLE.replace(",", " , ").encode(),
        (TABLE + "\n \n;;\n").replace(";;", ",").encode(),
        TABLE.rstrip("\n").encode(),
        TABLE.replace("1.5", '"1.5"').encode(),
    ],
)
def test_a_table_reads_the_same_whatever_program_has_written_it(data: bytes) -> None:
    assert list(rows_of(decoded(data))) == ROWS


def test_a_line_of_a_spreadsheet_that_gives_the_separator_is_no_row() -> None:
    text = "sep=;\n" + TABLE.replace(",", ";")
    assert list(rows_of(text)) == [Row(row.line + 1, row.cells) for row in ROWS]


def test_lines_count_as_in_an_editor() -> None:
    text = 'a,b\r\n\r\n1,"two\r\nlines"\r\n\r\n5,6'
    assert [row.line for row in rows_of(decoded(text.encode()))] == [1, 3, 6]


def test_what_is_no_text_is_refused_with_its_line() -> None:
    with pytest.raises(TextError, match=r"not UTF-8 text: .* at byte 4, line 2"):
        decoded(b"a,b\n\xfc,1\n")


@pytest.mark.parametrize(
    ("cell", "words"),
    [("0,4", "decimal comma, write 0.4"), ("-,5", "decimal comma"), ("x", "not a number"),
     ("", "not a number"), ("nan", "not a number"), ("inf", "not a number")],
)  # fmt: skip
def test_what_is_no_number_is_refused_with_its_line(cell: str, words: str) -> None:
    with pytest.raises(TextError, match=rf"line 7: .*{words}"):
        number_in(cell, "line 7")


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_survive(value: float) -> None:
    assert number_in(f" {value!r} ", "line 1") == value


@given(st.binary(max_size=200))
def test_any_bytes_are_a_table_or_a_clear_error(data: bytes) -> None:
    with suppress(TextError):
        assert all(any(row.cells) for row in rows_of(decoded(data)))


@pytest.mark.parametrize(
    ("text", "parts"),
    [("lab:801", ("lab", 801)), ("10.0.0.1:1", ("10.0.0.1", 1)), ("[::1]:801", ("::1", 801)),
     ("[fe80::1%eth0]:65535", ("fe80::1%eth0", 65535))],
)  # fmt: skip
def test_addresses_have_a_host_and_a_port(text: str, parts: tuple[str, int]) -> None:
    assert host_and_port(text) == parts


@pytest.mark.parametrize(
    "text",
    [
        "",
        "lab",
        "lab:",
        ":801",
        "lab:801:801",
        "::1:801",
        "lab:0",
        "lab:65536",
        "lab:²",
        "[]:1",
        "a b:1",
        "[lab:801]:801",
        "[10.0.0.1]:1",
    ],
)
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(TextError, match="must be HOST:PORT"):
        host_and_port(text)


@pytest.mark.parametrize(
    ("name", "hint"),
    [("tria", "; did you mean 'trio'?"), ("crazyflie", "; did you mean 'crazyflies'?"), ("h4", ""), ("", "")],
)
def test_an_unknown_name_is_answered_by_the_most_similar_one_if_any(name: str, hint: str) -> None:
    assert similar(name, SHIPPED) == hint
    assert similar(name, ()) == ""


def fails() -> None:
    np.linalg.inv(np.zeros((2, 2)))


def test_an_error_is_described_with_its_place_in_the_code_that_is_no_library() -> None:
    with pytest.raises(np.linalg.LinAlgError) as raised:
        fails()
    line = fails.__code__.co_firstlineno + 1
    assert described(raised.value) == f"LinAlgError: Singular matrix (test_user_text.py, line {line})"
    assert described(ValueError("no")) == "ValueError: no"
