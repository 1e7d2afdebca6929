"""Vectors as plain tuples, for settings and messages; commands import it, which need no numpy."""

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
