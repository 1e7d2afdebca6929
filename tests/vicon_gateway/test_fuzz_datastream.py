from fuzz_datastream import campaign


def test_ten_thousand_hostile_inputs_raise_nothing_but_the_documented_error() -> None:
    targets = campaign(10_000, seed=20_000)
    # Both sides of the decoders are reached, or the inputs would prove little.
    assert targets.refused > 1000
    assert targets.accepted > 1000
    assert targets.frames > 500
