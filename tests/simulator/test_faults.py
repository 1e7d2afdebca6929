"""What a request carries comes out as the same faults, and anything else is refused with its reason."""

import pytest

from rcopterx.bus.codec import decode, encode
from rcopterx.bus.requests import Inject, InjectedFault
from rcopterx.simulator.faults import (
    AddSubject,
    BreakRadio,
    Dribble,
    FaultError,
    Freeze,
    SetQuality,
    TimedFault,
    injected_faults,
    timed_faults,
)


def test_faults_come_out_of_a_request_as_they_went_in() -> None:
    table = (
        TimedFault(0.0, AddSubject("ghost", position_m=(0.5, 0.0, 1.0))),
        TimedFault(1.5, BreakRadio("h2", "off", duration_s=0.2)),
        TimedFault(2.0, Dribble(chunk_bytes=3)),
        TimedFault(3.0, SetQuality("heli1", 0.25)),
        TimedFault(4.0, Freeze()),
    )
    request = decode(encode(Inject(faults=injected_faults(table))), Inject)
    assert timed_faults(request.faults) == table


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"kind": "explode"}, "explode: Invalid value 'explode'"),
        ({}, "None: "),
        ({"kind": "occlude"}, "occlude: .*subject"),
        ({"kind": "close", "subject": "h1"}, "close: .*subject"),
        ({"kind": "set_quality", "subject": "h1", "quality": 2.0}, "set_quality: "),
    ],
)
def test_what_is_no_fault_is_refused_with_its_kind(fields: dict[str, bool | float | str], words: str) -> None:
    with pytest.raises(FaultError, match=words):
        timed_faults([InjectedFault(0.0, {**fields})])
