"""Texts of users: byte order marks, line ends, tables of spreadsheets, misspelt names, errors of plug-ins."""

import codecs
import csv
import ipaddress
import math
import re
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from traceback import walk_tb
from typing import Final, NamedTuple

SEPARATORS: Final = ",;\t"
_UTF_16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_ADDRESS: Final = re.compile(r"(?:\[([0-9A-Fa-f:.%\w]+)\]|([^\[\]:\s]+)):([0-9]{1,9})")
_LIBRARIES: Final = ("/numpy/", "/scipy/", "importlib")
_DECIMAL_COMMA: Final = re.compile(r"\s*[-+]?\d*,\d+\s*")


class TextError(ValueError):
    """A text that cannot be read; names the line as an editor counts it, and why."""


class Row(NamedTuple):
    """A line of a table."""

    line: int  # as an editor counts, from one
    cells: list[str]


def similar(name: str, known: Iterable[str]) -> str:
    """Return the end of an error about an unknown name: the known one that is most similar, if any."""
    found = get_close_matches(name, list(known), 1)
    return f"; did you mean {found[0]!r}?" if found else ""


def described(error: BaseException) -> str:
    """Return type and text of an error, with file and line below the caller, those of libraries excepted."""
    below = error.__traceback__ and error.__traceback__.tb_next
    files = ((frame.f_code.co_filename, line) for frame, line in walk_tb(below))
    places = [(name, line) for name, line in files if not any(part in name for part in _LIBRARIES)]
    where = f" ({Path(places[-1][0]).name}, line {places[-1][1]})" if places else ""
    return f"{type(error).__name__}: {error}{where}"


def text_of(path: Path) -> str:
    """Return the text of a file as `decoded` does; raises `OSError` or `TextError`."""
    return decoded(path.read_bytes())


def decoded(data: bytes) -> str:
    """Return UTF-8, or UTF-16 with its mark, without mark and with newlines; `TextError` if it is neither."""
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


def ip_version(host: str) -> int | None:
    """Return the version of an IP address, 4 or 6; None for a name."""
    try:
        return ipaddress.ip_address(host).version
    except ValueError:
        return None


def is_loopback(address: str) -> bool:
    """Whether only this computer can reach an address."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


def host_and_port(text: str) -> tuple[str, int]:
    """Return the parts of HOST:PORT, an IPv6 address being in brackets; raises `TextError`."""
    match = _ADDRESS.fullmatch(text)
    if match is None or not 0 < int(match[3]) < 65536 or (match[1] and ip_version(match[1]) != 6):
        hint = ", an IPv6 address in brackets" if text.count(":") > 1 else ""
        raise TextError(f"{text!r}, must be HOST:PORT{hint}")
    return match[1] or match[2], int(match[3])
