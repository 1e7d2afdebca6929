"""Flying one vehicle: what it is to do now (guidance), what time it is, where it will be after the delay."""
