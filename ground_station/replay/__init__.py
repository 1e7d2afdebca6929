"""Replaying flight logs: onto the bus for viewers, and through an agent that must repeat the flight."""
