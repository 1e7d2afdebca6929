"""One process per vehicle: a thin shell around a pure pilot, with layers as folders (`pyproject.toml`)."""
