"""Orders to processes of a fleet to misbehave, which `inside/sitecustomize.py` carries out."""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest.mock import patch

from rcopterx.ground_station.scripting.waiting import NotReachedError

VARIABLE: Final = "RCOPTERX_FAULT_ORDERS"
"""Environment variable with the directory in which processes find their orders."""
INSIDE: Final = Path(__file__).parent / "inside"


@contextmanager
def obedient_processes() -> Iterator[None]:
    """Have Python processes that this one starts meanwhile accept orders."""
    paths = [str(INSIDE), *filter(None, [os.environ.get("PYTHONPATH")])]
    # Processes that are ended may still write.
    with TemporaryDirectory(prefix="rcopterx-orders-", ignore_cleanup_errors=True) as directory:
        values = {VARIABLE: directory, "PYTHONPATH": os.pathsep.join(paths)}
        with patch.dict(os.environ, values):
            yield


def give_order(pid: int, order: str, **values: object) -> None:
    """Order a process to misbehave.

    `order` and `values`: one of `ORDERS` of `inside/sitecustomize.py`, and its arguments. Raises
    `NotReachedError`: the process was not started within `obedient_processes`, and a signal would end it; or
    it has ended.
    """
    path = Path(os.environ.get(VARIABLE, "/nowhere"), str(pid))
    if not path.exists():
        raise NotReachedError(f"process {pid} takes no orders; start the fleet with --up")
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"order": order, **values}) + "\n")
    try:
        os.kill(pid, signal.SIGUSR2)
    except ProcessLookupError:
        raise NotReachedError(f"process {pid} has ended") from None
