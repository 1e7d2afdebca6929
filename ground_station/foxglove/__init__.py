"""Flights in Foxglove's standard schemas: as files, and live for Foxglove and PlotJuggler."""
