"""Flights in Foxglove's standard schemas."""
