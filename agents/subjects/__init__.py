"""Tracked subjects that are no vehicles: vehicles follow them, or keep clear of them."""
