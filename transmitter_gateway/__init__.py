"""Commands to radio bytes: safety arbiter, calibration, serial port and one codec per radio."""
