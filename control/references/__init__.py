"""References as functions of time: trajectories, set points, smooth moves and paths."""
