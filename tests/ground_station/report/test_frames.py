"""Promises of flights in which the frame numbers of the Tracker restart."""

import numpy as np
import pytest
from support.recorded_flight import Flight, truth

from rcopterx.bus.messages import LeaderLink


@pytest.mark.parametrize("simulated", [False, True])
def test_frame_numbers_of_the_tracker_that_restart_do_not_mix_up_the_parts_of_a_flight(
    simulated: bool,
) -> None:
    flight, link = Flight(), LeaderLink(leader="h1", offset_m=(0.0, 1.0, 0.0))
    for epoch, start in ((1, 0.0), (2, 1.0)):
        for frame in range(10, 15):
            x = start + 0.1 * frame
            if simulated:
                flight.laboratory(frame, 0.0, h1=truth(x), h2=truth(x, 1.0))
            if frame < 14 or not simulated:  # the last pose of an epoch is lost
                flight.pose("h1", frame, (x, 0.0, 1.0), epoch=epoch)
                flight.pose("h2", frame, (x, 1.0, 1.0), epoch=epoch)
            if frame < 14:
                flight.plan("h1", frame, (x + 0.1, 0.0, 1.0, 0.0), epoch=epoch)
                flight.plan("h2", frame, (x + 0.1, 1.0, 1.0, 0.0), link, epoch=epoch)
    figures = flight.figures("h1", "h2")
    frames, flown = figures.flown("h1")
    assert frames.tolist() == list(range(10, 20))
    assert flown[:, 0] == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4, 2.0, 2.1, 2.2, 2.3, 2.4])
    assert figures.tracking_errors("h1")[1] == pytest.approx(np.zeros(8), abs=1e-9)
    assert figures.formation_error_m("h2") == pytest.approx(np.zeros(8), abs=1e-9)
