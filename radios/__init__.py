"""Radios: codecs behind the `RadioProtocol` interface, calibration, and limits of the arbiter."""
