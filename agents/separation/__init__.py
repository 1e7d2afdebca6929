"""Keeping clear of other vehicles by their plans."""
