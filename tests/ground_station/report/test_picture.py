"""Promises of the pictures of a flight."""

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure
from support.recorded_flight import Flight

from rcopterx.ground_station.report.picture import flight_svg


def test_pictures_show_every_vehicle_at_the_times_of_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight()
    for frame in range(100, 200):
        flight.pose("h1", frame, (0.0, 0.0, 1.0))
        if frame >= 150:  # seen a second later
            flight.pose("h2", frame, (0.0, 1.0, 1.0))
            flight.plan("h2", frame, (0.0, 1.0, 1.0, 0.0), start_s=0.0)
    drawn = Figure()

    def draw(_name: str, _size: object, draw_on: Callable[..., None], *data: object) -> str:
        draw_on(drawn, *data)
        return ""

    monkeypatch.setattr("rcopterx.ground_station.report.picture.svg_of", draw)
    flight_svg("flight", ["h1", "h2"], flight.figures("h1", "h2"))
    x_of_h2 = next(line for line in drawn.axes[0].lines if line.get_label() == "h2")
    (error_of_h2,) = (line for line in drawn.axes[3].lines if len(line.get_xdata()))
    for line in (x_of_h2, error_of_h2):
        assert np.asarray(line.get_xdata())[0] == pytest.approx(1.0)
