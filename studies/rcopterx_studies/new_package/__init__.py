"""Templates of packages that add a controller, an estimator or a vehicle type."""
