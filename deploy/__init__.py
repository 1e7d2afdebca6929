"""The fleet file, the supervisor and the ready fleets."""
