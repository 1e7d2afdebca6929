"""Manoeuvres and their checks, with which a laboratory accepts its set-up."""
