"""The simulated laboratory: plants, a Tracker emulator, radio module and receiver emulators."""
