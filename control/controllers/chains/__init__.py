"""Optimisation over chains of integrators: models of the axes and the solver of their quadratic programs."""
