"""Vehicle models: state, input, dynamics, limits and parameters."""
