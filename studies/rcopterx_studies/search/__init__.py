"""Search for flights that break a promise: whole fleets in one process, from one seed."""
