"""Vectors as plain tuples, for settings and messages; commands import it, which need no numpy."""

Two = tuple[float, float]
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
