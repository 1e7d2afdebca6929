"""Identification flights: excitation, recording, hover trim."""
