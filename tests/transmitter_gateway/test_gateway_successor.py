"""A transmitter gateway is killed in flight, and its successor continues without the bus."""

from gateway_bench import NAMES, Laboratory

from rcopterx.transmitter_gateway.inputs import State


def test_successor_flies_on_although_no_launcher_answers(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.kill()
    for throttles in laboratory.throttle_us.values():
        throttles.clear()
    laboratory.start()
    laboratory.run(0.5)
    assert laboratory.states() == {State.ARMED}
    assert all(min(laboratory.throttle_us[name]) > 1400 for name in NAMES)
