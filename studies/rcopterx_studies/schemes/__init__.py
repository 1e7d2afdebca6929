"""Schemes: controllers that coordinate their vehicles by messages of their own."""
