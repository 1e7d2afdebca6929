"""The lease of a vehicle, and the intent from which a successor continues."""
