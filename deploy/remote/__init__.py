"""Installs software, fleet file, certificates and the systemd unit on the hosts of a fleet."""
