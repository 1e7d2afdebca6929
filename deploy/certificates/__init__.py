"""Certificates of a fleet: names, files, issuing and checking."""
