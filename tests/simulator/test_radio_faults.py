"""Promises of faults of radio modules: now or by a time table, until their end or until recovery."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import IDEAL
from support.vehicle_types import COAXIAL

from rcopterx.radios.registry import create_protocol
from rcopterx.simulator.faults import BreakRadio, Close, FaultError, Recover, TimedFault
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose, Plant
from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_kinds import module_of
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.simulator.settings import SimulatedRadio
from rcopterx.simulator.vehicle_faults import VehicleFaults


def radio(path: Path, protocol: str) -> RadioPty:
    settings = SimulatedRadio(create_protocol(protocol), 1)
    return RadioPty(str(path), RadioLink(module_of(settings, 0.0), Receiver(1)))


def plants_of(radios: dict[str, RadioPty]) -> dict[str, Plant]:
    start = {name: BodyPose((0.0, 0.0, 0.0)) for name in radios}
    laboratory = Laboratory(dict.fromkeys(start, COAXIAL), start, IDEAL)
    return {name: laboratory.plants[name] for name in start}


@pytest.fixture
def radios(tmp_path: Path) -> Iterator[dict[str, RadioPty]]:
    found = {name: radio(tmp_path / name, kind) for name, kind in (("h1", "multi"), ("h2", "ppm"))}
    yield found
    for one in found.values():
        one.unplug()


def test_broken_radio_mends_by_itself_at_its_end(radios: dict[str, RadioPty]) -> None:
    faults = VehicleFaults(plants_of(radios), radios)
    fault = BreakRadio("h1", duration_s=0.5)
    faults.schedule([TimedFault(1.0, fault)], 10.0)
    for now_s, is_open in ((10.9, True), (11.0, False), (11.4, False), (11.5, True)):
        faults.advance(now_s)
        assert radios["h1"].is_open is is_open
        assert faults.table.active == (() if is_open else (fault,))
    assert radios["h2"].is_open


def test_broken_radios_stay_so_until_recovery(radios: dict[str, RadioPty]) -> None:
    faults = VehicleFaults(plants_of(radios), radios)
    faults.schedule([TimedFault(0.0, BreakRadio("h1")), TimedFault(0.0, BreakRadio("h2", "off"))], 0.0)
    faults.advance(1e6)
    assert not radios["h1"].is_open
    faults.schedule([TimedFault(1.0, Recover()), TimedFault(0.5, Close())], 1e6)
    faults.advance(1e6 + 1)
    assert radios["h1"].is_open
    assert faults.table.active == ()


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (BreakRadio("h9"), r"no vehicle 'h9', there are h1, h2"),
        (BreakRadio("h2", "refusing"), r"h2: only a Multiprotocol module"),
    ],
)
def test_fault_that_cannot_be_is_refused(fault: BreakRadio, reason: str, radios: dict[str, RadioPty]) -> None:
    with pytest.raises(FaultError, match=reason):
        VehicleFaults(plants_of(radios), radios).check([TimedFault(0.0, Close()), TimedFault(0.0, fault)])
    VehicleFaults(plants_of(radios), radios).check(
        [TimedFault(0.0, Close()), TimedFault(0.0, BreakRadio("h1", "refusing"))]
    )


LINES = st.tuples(st.floats(0, 5), st.sampled_from(["unplugged", "off"]), st.floats(0, 5))


@given(lines=st.lists(LINES, max_size=6))
def test_whatever_was_broken_for_a_time_is_whole_in_the_end(
    lines: list[tuple[float, str, float]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    one = radio(tmp_path_factory.mktemp("radio") / "h1", "multi")
    faults = VehicleFaults(plants_of({"h1": one}), {"h1": one})
    table = [TimedFault(at_s, BreakRadio("h1", what, duration_s=span_s)) for at_s, what, span_s in lines]
    faults.schedule(table, 0.0)
    for step in range(50):
        faults.advance(0.25 * step)
    assert faults.table.active == ()
    assert one.is_open
    one.unplug()
