"""Presets of the simulated laboratory, by constants."""

from rcopterx.simulator.conditions import PRESETS

IDEAL = PRESETS["ideal"]
LABORATORY = PRESETS["laboratory"]
HELICOPTER = PRESETS["helicopter"]
HELICOPTERS = PRESETS["helicopters"]
COAXES = PRESETS["coaxes"]
CRAZYFLIES = PRESETS["crazyflies"]
