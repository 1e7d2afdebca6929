"""Fault flights: what is broken in flight, what is promised, and what was seen of it."""
