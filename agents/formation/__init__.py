"""The formation law and what follows from it, without bus and clock: offsets, topology, succession."""
