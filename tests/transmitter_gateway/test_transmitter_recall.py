"""A restarted gateway requests the last written frame until it has an answer."""

import pytest
from support.waiting import wait_for

from rcopterx.bus.messages import Applied
from rcopterx.bus.requests import RecallTransmitterReply, Reply
from rcopterx.bus.session import NotServedError, RequestFailedError
from rcopterx.transmitter_gateway.inputs import NEUTRAL, LastApplied, State
from rcopterx.transmitter_gateway.recall import Recall, last_applied

APPLIED = Applied(
    state="hold",
    input=(0.1, 0.2, 0.5, 0.0),
    pulse_width_us=(1500.0,),
    epoch=1,
    frame=2,
    sequence=3,
    lease=7,
    fresh=True,
)


class ScriptedBus:
    """Answers requests as a script says; a vehicle whose script is used up is not served."""

    def __init__(self, script: dict[str, list[Reply | Exception]]) -> None:
        self.script = script
        self.asked: list[str] = []
        self.woken = 0

    def clock(self) -> float:
        return 100.0

    def wake(self) -> None:
        self.woken += 1

    def request(self, vehicle: str, *_: object, **__: object) -> Reply:
        self.asked.append(vehicle)
        said = self.script[vehicle].pop(0) if self.script[vehicle] else NotServedError("nobody")
        if isinstance(said, Exception):
            raise said
        return said


def recalled(script: dict[str, list[Reply | Exception]]) -> tuple[dict[str, LastApplied | None], ScriptedBus]:
    bus = ScriptedBus(script)
    recall = Recall(bus, script)  # type: ignore[arg-type]  # no bus
    recall.join()
    return dict(recall.answers()), bus


def test_every_vehicle_is_asked_for_and_each_answer_wakes_the_loop() -> None:
    reply = RecallTransmitterReply(accepted=True, applied=APPLIED, age_s=0.25, lease=7, issued=9)
    answers, bus = recalled({"h1": [reply], "h2": []})
    assert answers == {"h1": LastApplied(State.HOLD, (0.1, 0.2, 0.5, 0.0), 99.75, 7, 9), "h2": None}
    assert bus.woken == 2


def test_launcher_that_does_not_answer_is_asked_again_after_the_others() -> None:
    reply = RecallTransmitterReply(accepted=True, applied=APPLIED, age_s=0.0)
    silent = RequestFailedError("Timeout")
    answers, bus = recalled({"h1": [silent, silent, reply], "h2": [reply]})
    assert bus.asked == ["h1", "h2", "h1", "h1"]
    assert {name: last and last.state for name, last in answers.items()} == dict.fromkeys(
        ("h1", "h2"), State.HOLD
    )


def test_close_ends_the_asking() -> None:
    bus = ScriptedBus({"h1": [RequestFailedError("Timeout") for _ in range(10**6)]})
    recall = Recall(bus, bus.script)  # type: ignore[arg-type]  # no bus
    wait_for(lambda: len(bus.asked) > 2, "nobody is asked")
    recall.close()
    asked = len(bus.asked)
    assert recall.answers() == []
    assert len(bus.asked) == asked


@pytest.mark.parametrize(
    ("reply", "expected"),
    [
        (Reply(accepted=False), None),
        (RecallTransmitterReply(accepted=False), None),
        (
            RecallTransmitterReply(accepted=True, applied=APPLIED, age_s=1.0, lease=7, issued=9, killed=True),
            LastApplied(State.KILLED, NEUTRAL, 9.0, 7, 9),
        ),
        (
            RecallTransmitterReply(accepted=True, age_s=1.0, killed=True),
            LastApplied(State.KILLED, NEUTRAL, 9.0, 0, 0),
        ),
    ],
    ids=["another reply", "nothing known", "killed", "killed and never written"],
)
def test_answer_is_read(reply: Reply, expected: LastApplied | None) -> None:
    assert last_applied(reply, 10.0) == expected
