"""Watching and steering a fleet: the scripting interface, recorder, reports."""
