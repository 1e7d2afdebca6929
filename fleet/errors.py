"""Errors of fleet files."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager

from rcopterx.user_text import similar


class FleetError(ValueError):
    """The fleet file cannot be used; names the file, the field and what is allowed."""


@contextmanager
def errors_at(where: object, *kinds: type[Exception]) -> Iterator[None]:
    """Put a place before errors, by default `FleetError`, of the block; they become `FleetError`."""
    wrapped = kinds or (FleetError,)
    try:
        yield
    except wrapped as error:
        raise FleetError(f"{where}: {error}") from None


def check_known(at: str, what: str, name: str, known: Collection[str]) -> None:
    """Refuse a name at the place `at` that is none of the known ones; raises `FleetError`."""
    if name not in known:
        raise FleetError(f"{at}: unknown {what} {name!r}, known are {', '.join(known)}{similar(name, known)}")
