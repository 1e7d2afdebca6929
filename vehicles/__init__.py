"""What a vehicle is: state, input, dynamics, limits and parameters."""
