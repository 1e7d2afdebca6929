"""Links of the rig: losses and delays, drawn from a seed."""

import pytest

from rcopterx_studies.experiments.network import LinkQuality, Network

NAMES = ("h1", "h2", "h3")


def received(loss: float, seed: int = 0, count: int = 2000) -> list[int]:
    network: Network[int] = Network(LinkQuality(loss), NAMES, seed, 0)
    found = []
    for number in range(count):
        network.send("h1", number, float(number))
        newest = network.newest("h2", float(number)).get("h1")
        if newest is not None and newest.message == number:
            found.append(number)
    return found


@pytest.mark.parametrize("loss", [0.0, 0.2, 0.5])
def test_fraction_of_the_messages_is_lost(loss: float) -> None:
    assert len(received(loss)) == pytest.approx(2000 * (1 - loss), abs=80)


def test_same_seed_loses_the_same_messages() -> None:
    assert received(0.5) == received(0.5) != received(0.5, seed=1)


def test_message_arrives_after_the_delay_at_all_others() -> None:
    network: Network[str] = Network(LinkQuality(delay_s=0.06), NAMES, 0, 0)
    network.send("h1", "hello", 1.0, size=5)
    assert not network.newest("h2", 1.05)
    for name in ("h2", "h3"):
        assert network.newest(name, 1.06)["h1"] == ("hello", 1.0)
    assert not network.newest("h1", 2.0)
    assert (network.sent, network.bytes) == (1, 5)
