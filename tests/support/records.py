"""Records with changed fields, as `copy.replace` gives them from Python 3.13 on."""

from typing import NamedTuple, TypeVar

Record = TypeVar("Record", bound=NamedTuple)


def replace(record: Record, /, **changes: object) -> Record:
    """A copy of a NamedTuple with other values in some fields."""
    return record._replace(**changes)
