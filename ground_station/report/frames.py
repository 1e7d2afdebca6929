"""Frame numbers of a recorded flight that continue where those of the Tracker restart."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TypeVar

from msgspec import structs

from rcopterx.bus.host_messages import LaboratoryState
from rcopterx.bus.messages import Applied, Plan, Pose

S = TypeVar("S", LaboratoryState, Pose, Plan, Applied)


def restart_offsets(frames: Iterable[int]) -> list[int]:
    """What to add to each of these frame numbers, in order, so that they continue after a jump back."""
    offsets, offset = [], 0
    for before, frame in pairwise((0, *frames)):
        if frame < before:
            offset += before + 1 - frame
        offsets.append(offset)
    return offsets


def epoch_offsets(poses: Iterable[Pose], true_offsets: Sequence[int]) -> Mapping[int, int]:
    """What to add to frame numbers of each epoch; those of the simulated laboratory have `true_offsets`."""
    stamps = sorted({(pose.epoch, pose.frame) for pose in poses})
    offsets = restart_offsets(frame for _, frame in stamps)
    # States of the laboratory have no epoch, but as many restarts, at frames that may have no pose.
    true = dict(zip(dict.fromkeys(offsets), dict.fromkeys(true_offsets), strict=False))
    return {epoch: true.get(offset, offset) for (epoch, _), offset in zip(stamps, offsets, strict=True)}


def shifted(message: S, offset: int) -> S:
    """Return a message with `offset` added to its frame number."""
    return structs.replace(message, frame=message.frame + offset) if offset else message
