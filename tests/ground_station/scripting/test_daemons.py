"""What differs between hosts is named before anything flies."""

from rcopterx.bus.host_messages import LinkState, RouterStatus
from rcopterx.bus.requests import IdentifyReply
from rcopterx.ground_station.scripting.daemons import differences
from rcopterx.ground_station.scripting.notes import clock_differences


def answer(host: str, version: str) -> IdentifyReply:
    return IdentifyReply(accepted=True, fleet="lab", host=host, digest="d", version=version)


def test_hosts_with_another_version_are_named() -> None:
    answers = {"a": answer("a", "0.1.0"), "b": answer("b", "0.2.0"), "c": answer("c", "")}
    assert differences(answers, "0.1.0") == [
        "host b runs version 0.2.0, this program is 0.1.0",
        "host c runs version unknown, this program is 0.1.0",
    ]


def test_hosts_whose_clocks_differ_are_named_with_a_remedy() -> None:
    def link(offset_s: float | None) -> LinkState:
        return LinkState(linked=True, redials=0, late=0, clock_offset_s=offset_s, round_trip_s=0.001)

    status = RouterStatus(links={"near": link(0.05), "far": link(-3.0), "unknown": link(None)})
    (line,) = clock_differences({"main": status}, "main", 0.1)
    assert line.startswith("host far: clock 3000.0 +- 0.5 ms behind that of main")
    assert line.endswith("set the clocks, for instance by chrony")
    assert clock_differences({}, "main", 0.1) == []
