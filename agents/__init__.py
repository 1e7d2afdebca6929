"""One process per vehicle: a thin shell around the pure pilot."""
