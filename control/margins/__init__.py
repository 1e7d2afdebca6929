"""How far a vehicle may be from its model before its closed loop becomes unstable."""
