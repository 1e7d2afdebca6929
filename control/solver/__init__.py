"""Solvers of linear-quadratic optimal control problems with bounds: Riccati sweeps, and OSQP."""
