"""Discrete-time models of vehicles and prediction with them."""
