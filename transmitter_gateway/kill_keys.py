"""Kill by a key press on the gateway's own terminal."""

import os
import sys
import termios
import tty
from contextlib import AbstractContextManager

KILL_KEYS = frozenset(b" kK")
HINT = "space or k: cut all motors of this gateway at once, latching; Ctrl-C: bring its vehicles down and end"


class KillKeys(AbstractContextManager["KillKeys"]):
    """Single keys of a terminal, if there is one, without waiting and without echo until the end."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._before: list[int | list[bytes | int]] | None = None

    @property
    def descriptors(self) -> tuple[int, ...]:
        """Descriptors to wait for; empty without a terminal."""
        return () if self._before is None else (self._descriptor,)

    def __enter__(self) -> "KillKeys":
        # A gateway in the background must not touch the terminal: it would be stopped.
        if os.isatty(self._descriptor) and os.tcgetpgrp(self._descriptor) == os.getpgrp():
            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor)
            print(HINT, file=sys.stderr, flush=True)
        return self

    def __exit__(self, *_: object) -> None:
        before, self._before = self._before, None
        if before is not None:
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, before)

    def pressed(self) -> bool:
        """Whether a kill key is among the keys that wait; call it when the descriptor is readable."""
        try:
            keys = os.read(self._descriptor, 1024)
        except OSError:
            keys = b""
        if not keys:
            # The terminal is gone; it would be readable for ever.
            self._before = None
        return bool(KILL_KEYS & set(keys))
