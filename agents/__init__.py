"""One process per vehicle: a thin shell around a pure pilot.

At the top is what an agent is; the folders are layers below it. No import runs upwards (`pyproject.toml`).
"""
