"""Which controller and estimator fly a vehicle, with what settings, and how these change in flight."""
