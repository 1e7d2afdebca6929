"""The turning experiment: followers on arms keep their places while their leader turns."""

from rcopterx.experiments import turning
from rcopterx.experiments.runner import Options


def test_followers_on_arms_keep_their_places_while_their_leader_turns() -> None:
    result = turning.EXPERIMENT.fly(Options((0,), quick=True), lambda *_: None)
    for condition, limit_mm in (("ideal", 5.0), ("laboratory", 45.0)):
        (row,) = result.document[condition]["0.64 m"].values()
        assert 0.0 < row["rms_mm"] <= row["max_mm"] < limit_mm
