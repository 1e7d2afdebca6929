"""The part of a fleet on one host: launcher, host service, checkpoint, capacity, states of vehicles."""
