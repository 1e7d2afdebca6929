"""Brings software, fleet file, certificates and the unit of systemd to the hosts of a fleet."""
