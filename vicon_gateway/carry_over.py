"""Which objects are valid after a packet (Vicon DataStream SDK)."""

from collections.abc import Iterable

from rcopterx.vicon_gateway.control_objects import DYNAMIC_TYPES, STATIC_TYPES, Contents, ObjectType

_CONTENTS = int(ObjectType.CONTENTS)
_NOTHING: frozenset[int] = frozenset()


class CarryOver:
    """Applies packets to the two classes of objects, each with its own rule.

    Static objects stay until a packet carries any static object; then the types named as unchanged are kept
    and all others become empty. Dynamic objects are rebuilt by every packet that carries one; types named as
    unchanged are copied from the previous frame. Types are carried over as a whole. `payloads` are the
    objects that are valid now, `contents` that of the last packet.
    """

    def __init__(self) -> None:
        self.payloads: dict[int, list[bytes]] = {}
        self.contents: Contents | None = None

    def apply(self, objects: Iterable[tuple[int, bytes]]) -> bool:
        """Apply one packet's objects; True when it makes a frame, that is, carries a dynamic object.

        Raises `WireError` for a malformed Contents object.
        """
        present: dict[int, list[bytes]] = {}
        for kind, payload in objects:
            present.setdefault(kind, []).append(payload)
        unchanged = self._unchanged(present.pop(_CONTENTS, None))
        is_frame = not DYNAMIC_TYPES.isdisjoint(present)
        kept = self.payloads
        if is_frame:
            kept = {kind: was for kind, was in kept.items() if kind in unchanged or kind in STATIC_TYPES}
        if not STATIC_TYPES.isdisjoint(present):
            kept = {kind: was for kind, was in kept.items() if kind in unchanged or kind in DYNAMIC_TYPES}
        known = {kind: new for kind, new in present.items() if kind in STATIC_TYPES or kind in DYNAMIC_TYPES}
        self.payloads = {**kept, **known}
        return is_frame

    def _unchanged(self, payloads: list[bytes] | None) -> frozenset[int]:
        if payloads is None:
            self.contents = None
            return _NOTHING
        self.contents = Contents.parse(payloads[0])
        return self.contents.unchanged
