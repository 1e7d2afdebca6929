"""Identification of a vehicle in flight: excitation of its sticks, recording, and the fit of its model."""
