"""Work that takes longer than a control period, done in a thread beside the control loop."""

from collections.abc import Callable
from concurrent import futures
from typing import Generic, TypeVar

T = TypeVar("T")


class WorkAhead(Generic[T]):
    """At most one piece of work under way; `wake` is called from the thread when it is done."""

    def __init__(self, name: str, wake: Callable[[], None]) -> None:
        self._executor = futures.ThreadPoolExecutor(max_workers=1, thread_name_prefix=name)
        self._wake = wake
        self._future: futures.Future[T] | None = None

    @property
    def busy(self) -> bool:
        """Whether work is under way, or done and not yet finished."""
        return self._future is not None

    def begin(self, work: Callable[[], T]) -> None:
        """Begin a piece of work; only while not `busy`."""
        self._future = self._executor.submit(work)
        self._future.add_done_callback(lambda _: self._wake())

    def wait(self) -> None:
        """Wait for the end of the work, if any."""
        if self._future is not None:
            futures.wait([self._future])

    def finish(self) -> tuple[T] | None:
        """Return the result of the work, or raise its exception; None while there is no result."""
        future = self._future
        if future is None or not future.done():
            return None
        self._future = None
        return (future.result(),)
