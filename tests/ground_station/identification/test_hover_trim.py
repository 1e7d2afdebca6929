import pytest

from rcopterx.ground_station.identification.hover_trim import HoverError, mean_of_hover

HOVER = (0.04, -0.03, 0.55, 0.01)


def test_mean_of_a_steady_hover() -> None:
    inputs = [(HOVER[0] + (-1) ** n * 0.1, *HOVER[1:]) for n in range(100)]
    assert mean_of_hover(["armed"] * 100, inputs, 2.0) == pytest.approx(HOVER)


@pytest.mark.parametrize(
    ("states", "inputs", "words"),
    [
        (["armed"] * 30, [HOVER] * 30, "only 30 frames in 2 s"),
        (["armed"] * 60 + ["hold"] * 40, [HOVER] * 100, "the arbiter was hold"),
        (["armed"] * 100, [HOVER] * 50 + [(0.4, 0.0, 0.55, 0.0)] * 50, "changed by 0.36"),
    ],
)
def test_anything_but_a_steady_hover_is_refused(
    states: list[str], inputs: list[tuple[float, ...]], words: str
) -> None:
    with pytest.raises(HoverError, match=words):
        mean_of_hover(states, inputs, 2.0)
