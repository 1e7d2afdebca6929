"""Lockstep: the time of a fleet stands still until all of its processes have finished their work."""
