"""A bad network loses, delays, doubles and reorders the given shares of messages."""

from functools import partial

from support.waiting import wait_for

from rcopterx_studies.faults.impairment import OVERTAKEN_S, Impairment, LateSender


def test_a_sound_network_sends_every_message_once_and_at_once() -> None:
    assert [Impairment().delays_s() for _ in range(5)] == [[0.0]] * 5


def test_shares_of_the_messages_are_lost_doubled_and_overtaken() -> None:
    assert Impairment(loss=1.0).delays_s() == []
    assert Impairment(duplicates=1.0, delay_s=0.02).delays_s() == [0.02, 0.02]
    assert Impairment(reordering=1.0).delays_s() == [OVERTAKEN_S]
    impairment = Impairment(loss=0.1, seed=1)
    lost = sum(not impairment.delays_s() for _ in range(1000))
    assert 70 < lost < 130


def test_the_same_seed_loses_the_same_messages() -> None:
    first, second = Impairment(loss=0.5, seed=3), Impairment(loss=0.5, seed=3)
    assert [first.delays_s() for _ in range(50)] == [second.delays_s() for _ in range(50)]


def test_late_messages_are_sent_in_the_order_of_their_times() -> None:
    late, sent = LateSender(), list[int]()
    for number in (*range(0, 100, 2), *range(1, 100, 2)):
        late.call(0.1 + 0.002 * number, partial(sent.append, number))
    wait_for(lambda: len(sent) == 100, "not all are sent")
    assert sent == list(range(100))
