"""Processes of a fleet on its hosts: roles, launcher, watchdog, certificates and installation."""
