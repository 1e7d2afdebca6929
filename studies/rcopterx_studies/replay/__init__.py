"""Replays of agents of flight logs, which must repeat the flight, and digests of flights in lockstep."""
