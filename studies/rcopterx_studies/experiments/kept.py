"""A file of finished flights, with which an interrupted experiment continues.

One line of JSON per flight, with the digest of the code, the conditions and the length it was flown with.
Lines with other ones stay in the file and are not used.
"""

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final, get_type_hints

import msgspec
import numpy as np

from rcopterx import agents, bus, control, formation, simulator, vehicles
from rcopterx.fleet.schema import FleetError, errors_at
from rcopterx_studies import arena, experiments, schemes

FLOWN_BY: Final = (agents, bus, control, formation, simulator, vehicles, arena, experiments, schemes)
"""Packages whose code determines the result of a flight."""


class KeptFlights:
    """Results of flights by label, in a file that each new flight is appended to.

    `context` is what besides label and code a flight depends on, as JSON. Raises `FleetError`: a line that is
    not a kept flight, or a file that cannot be read or written.
    """

    def __init__(self, path: Path, context: Mapping[str, object]) -> None:
        self._path = path
        self._context = {**context, "code": code_digest()}
        self._found: dict[str, object] = {}
        try:
            self._load()
        except OSError as error:
            raise FleetError(f"{path}: {error.strerror}") from None

    def __contains__(self, label: str) -> bool:
        """Whether a flight is kept."""
        return label in self._found

    def result(self, label: str, flight: partial[Any]) -> Any:
        """Result of a kept flight; `FleetError` if it is not of the type that `flight` returns."""
        kind = get_type_hints(flight.func)["return"]
        with errors_at(f"{self._path}: {label}", msgspec.ValidationError):
            return msgspec.convert(
                self._found[label], kind, dec_hook=lambda _, rows: np.array(rows, dtype=float)
            )

    def add(self, label: str, result: object) -> None:
        """Keep a flight that was just flown."""
        plain = msgspec.to_builtins(result, enc_hook=np.ndarray.tolist)
        self._found[label] = plain
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({**self._context, "flight": label, "result": plain}) + "\n")

    def _load(self) -> None:
        there = self._path.exists()
        text = self._path.read_text(encoding="utf-8") if there else ""
        whole = text[: text.rfind("\n") + 1]
        for number, line in enumerate(whole.splitlines(), 1):
            where = f"{self._path}, line {number}: not a kept flight"
            with errors_at(where, ValueError, AttributeError, KeyError, TypeError):
                row = json.loads(line)
                label, result = row.pop("flight"), row.pop("result")
            if row == self._context:
                self._found[label] = result
        if whole != text or not there:
            # An experiment that was killed while it wrote leaves half a line.
            self._path.write_text(whole, encoding="utf-8")


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Digest of the source files of `FLOWN_BY`."""
    digest = hashlib.sha256()
    for package in FLOWN_BY:
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
