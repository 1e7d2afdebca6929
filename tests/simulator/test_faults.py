"""What a request carries comes out as the same faults, and anything else is refused with its reason."""

import math
from typing import Any

import pytest

from rcopterx.bus.codec import decode, encode
from rcopterx.bus.requests import MAX_FAULT_FIELDS, Inject, InjectedFault
from rcopterx.simulator.faults import (
    AddSubject,
    BreakRadio,
    Dribble,
    FaultError,
    Freeze,
    SetQuality,
    TimedFault,
    timed_faults,
)
from rcopterx_studies.faults.scenario import FAULTS, injected_faults


@pytest.mark.parametrize("kind", FAULTS)
def test_every_fault_with_all_its_fields_fits_into_a_request(kind: str) -> None:
    assert len(FAULTS[kind].__struct_fields__) + len(("kind",)) <= MAX_FAULT_FIELDS


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
        ({"kind": "set_quality", "subject": "h1", "quality": 2.0}, "set_quality: .*<= 1.0"),
        ({"kind": "silence", "duration_s": -1.0}, "silence: .*>= 0.0 - at `.*duration_s"),
        ({"kind": "silence", "duration_s": math.nan}, "silence: .*duration_s"),
        ({"kind": "break_vehicle", "vehicle": "h1", "duration_s": -1.0}, "break_vehicle: .*duration_s"),
        ({"kind": "dribble", "chunk_bytes": 0}, "dribble: .*chunk_bytes"),
        ({"kind": "dribble", "interval_s": 2.0}, "dribble: .*interval_s"),
        ({"kind": "delay", "delay_s": 11.0}, "delay: .*delay_s"),
        ({"kind": "burst", "frames": 0}, "burst: .*frames"),
        ({"kind": "reset_frame_id", "frame": 0xFFFFFFFF}, "reset_frame_id: .*frame"),
        ({"kind": "unknown_object", "size_bytes": 10**9}, "unknown_object: .*size_bytes"),
        (
            {"kind": "displace_pose", "subject": "h1", "offset_m": (math.nan, 0.0, 0.0)},
            "displace_pose: .*offset",
        ),
        ({"kind": "add_subject", "subject": "h1", "position_m": (0.0, 1e9, 0.0)}, "add_subject: .*position"),
    ],
)
def test_what_is_no_fault_is_refused_with_its_kind(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(FaultError, match=words):
        timed_faults([InjectedFault(0.0, {**fields})])
