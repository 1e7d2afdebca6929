"""An agent whose controller or estimator fails goes on flying, and says so."""

import pytest
from agent_bench import HOVER, Bench, Join
from support.failing import FailingController
from support.flight import ExactEstimator, NotedController

from rcopterx.agents.flight.timeline import INPUT_UNIT
from rcopterx.bus.session import BusAddress
from rcopterx.control.interfaces import Measurement


class RaisingEstimator(ExactEstimator):
    """Raises at every pose."""

    def correct(self, measurement: Measurement) -> bool:
        raise ZeroDivisionError("no poses")


def test_agent_flies_on_by_the_default_controller_when_its_own_raises(
    join: Join, bus_address: BusAddress, caplog: pytest.LogCaptureFixture
) -> None:
    bench = Bench(join, bus_address)
    bench.start()
    sound = NotedController(HOVER[None, :])
    bench.pilot.step_guard.default = sound
    bench.pilot.use_controller(
        FailingController(sound, [None, "raises", "raises"] + 20 * ["returns nothing"])
    )
    for _ in range(12):
        bench.see()
        command = bench.command_of(bench.frame)
        assert command.input == pytest.approx(tuple(HOVER), abs=INPUT_UNIT)
    diagnostics = bench.status().diagnostics
    assert diagnostics.controller == "cascade"
    assert diagnostics.fallbacks["controller_raised"] == 2
    assert diagnostics.fallbacks["controller_unusable"] == 3
    assert diagnostics.fallbacks["controller_replaced"] == 1
    (remark,) = diagnostics.remarks
    assert "the default controller flies until one is chosen" in remark
    assert caplog.text.count(remark) == 1


def test_agent_flies_on_by_the_default_estimator_when_its_own_raises(
    join: Join, bus_address: BusAddress
) -> None:
    bench = Bench(join, bus_address)
    bench.start()
    bench.pilot.use_estimator(RaisingEstimator())
    for _ in range(3):
        bench.see()
        bench.command_of(bench.frame)
    diagnostics = bench.status().diagnostics
    assert diagnostics.fallbacks["estimator_raised"] == 3
    assert "ZeroDivisionError: no poses" in diagnostics.remarks[0]
