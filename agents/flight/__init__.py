"""Flying one vehicle: phases, the reference of the moment, the fleet clock, prediction through the delay."""
