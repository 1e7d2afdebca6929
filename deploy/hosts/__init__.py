"""The part of a fleet on one host: launch, membership, capacity, recall, states of vehicles."""
