"""What is allowed in a field of the fleet file, read from the types of its tables."""

import re
from typing import Any

from msgspec import inspect

_STEP = re.compile(r"\.(\w+)|\[")


def allowed_at(kind: Any, below: str) -> tuple[str, ...]:
    """Names that a place of a file may have: fields of a table, or words of a choice.

    Parameters
    ----------
    kind
        Type of the table that `below` begins at.
    below
        Path as msgspec tells it, for instance `.transmitter` or `.follow[0].frame`.

    Returns
    -------
    tuple of str
        Empty where neither names nor words are listed, for instance for a number.
    """
    node: Any = inspect.type_info(kind)
    for step in _STEP.finditer(below):
        node = _inside(_without_none(node), step[1])
    node = _without_none(node)
    if isinstance(node, inspect.StructType):
        return tuple(field.encode_name for field in node.fields)
    return tuple(map(str, node.values)) if isinstance(node, inspect.LiteralType) else ()


def _inside(node: Any, name: str | None) -> Any:
    """Type of a field of a table, or of the items of a mapping or an array."""
    match node:
        case inspect.StructType():
            return next(field.type for field in node.fields if field.encode_name == name)
        case inspect.DictType():
            return node.value_type
        case inspect.VarTupleType() | inspect.ListType():
            return node.item_type
        case _:
            return inspect.AnyType()


def _without_none(node: Any) -> Any:
    if not isinstance(node, inspect.UnionType):
        return node
    return next(member for member in node.types if not isinstance(member, inspect.NoneType))
