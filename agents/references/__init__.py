"""Where a vehicle shall be: trajectories, set points and paths, as functions of time."""
