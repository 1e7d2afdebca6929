"""Work that takes longer than a control period, done in a thread beside the control loop."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class WorkAhead(Generic[T]):
    """At most one piece of work under way."""

    def __init__(self, name: str, wake: Callable[[], None] = lambda: None) -> None:
        self._name, self._wake = name, wake
        self._thread: threading.Thread | None = None
        self._result: tuple[T] | None = None
        self._error: BaseException | None = None

    @property
    def busy(self) -> bool:
        """Whether something is under way, or done and not yet finished."""
        return self._thread is not None

    def begin(self, work: Callable[[], T]) -> None:
        """Begin a piece of work; only while not `busy`."""
        self._result, self._error = None, None
        self._thread = threading.Thread(target=self._run, args=(work,), name=self._name)
        self._thread.start()

    def _run(self, work: Callable[[], T]) -> None:
        try:
            self._result = (work(),)
        except BaseException as error:  # noqa: BLE001 - raised again in the thread that finishes
            self._error = error
        self._wake()

    def wait(self) -> None:
        """Wait until what is under way is done, where no control loop must go on meanwhile."""
        if self._thread is not None:
            self._thread.join()

    def finish(self) -> tuple[T] | None:
        """Result of the work; None while there is none.

        Raises
        ------
        BaseException
            What the work raised.
        """
        if self._thread is None or (self._result is None and self._error is None):
            return None
        self._thread.join()
        result, error = self._result, self._error
        self._thread, self._result, self._error = None, None, None
        if error is not None:
            raise error
        return result
