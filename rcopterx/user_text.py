"""Reads texts and tables of users: byte order marks, line ends of Windows, separators of spreadsheets."""

import codecs
import csv
import ipaddress
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

SEPARATORS: Final = ",;\t"
_UTF_16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_ADDRESS: Final = re.compile(r"(?:\[([0-9A-Fa-f:.%\w]+)\]|([^\[\]:\s]+)):([0-9]{1,9})")
_DECIMAL_COMMA: Final = re.compile(r"\s*[-+]?\d*,\d+\s*")


class TextError(ValueError):
    """A text that cannot be read; names the line as an editor counts it, and why."""


class Row(NamedTuple):
    """A line of a table."""

    line: int  # as an editor counts, from one
    cells: list[str]


def text_of(path: Path) -> str:
    """Return the text of a file as `decoded` does; raises `OSError` or `TextError`."""
    return decoded(path.read_bytes())


def decoded(data: bytes) -> str:
    """Return text without byte order mark, its lines ended by newlines; `TextError` if it is none.

    It is UTF-8, or with its mark UTF-16.
    """
    try:
        text = data.decode("utf-16" if data.startswith(_UTF_16) else "utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise TextError(f"not UTF-8 text: {error.reason} at byte {error.start}, line {line}") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def rows_of(text: str) -> Iterator[Row]:
    """Yield the lines of a table with cells between commas, semicolons or tabs; blank lines are left out.

    The first line decides which; it may be `sep=;`. Spaces around cells are removed. Raises `TextError`.
    """
    first = next(filter(str.strip, text.split("\n")), "")
    separator = max(SEPARATORS, key=first.count)
    lines = text.splitlines(keepends=True)
    if first == f"sep={separator}" and text.startswith(first):
        lines[0] = "\n"
    reader = csv.reader(lines, delimiter=separator)
    line = 1
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                yield Row(line, stripped)
            line = reader.line_num + 1
    except csv.Error as error:
        raise TextError(f"line {line}: {error}") from None


def number_in(cell: str, where: str) -> float:
    """Return the finite number of a cell; `TextError` begins with `where`, such as `line 3`."""
    if _DECIMAL_COMMA.fullmatch(cell):
        raise TextError(f"{where}: {cell!r} has a decimal comma, write {cell.replace(',', '.')}")
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise TextError(f"{where}: {cell!r} is not a number")
    return value


def is_ipv6(address: str) -> bool:
    """Whether a host is the literal of an IPv6 address."""
    try:
        return ipaddress.ip_address(address).version == 6
    except ValueError:
        return False


def host_and_port(text: str) -> tuple[str, int]:
    """Return the parts of HOST:PORT, an IPv6 address being in brackets; raises `TextError`."""
    match = _ADDRESS.fullmatch(text)
    if match is None or not 0 < int(match[3]) < 65536 or (match[1] and not is_ipv6(match[1])):
        hint = ", an IPv6 address in brackets" if text.count(":") > 1 else ""
        raise TextError(f"{text!r}, must be HOST:PORT{hint}")
    return match[1] or match[2], int(match[3])
