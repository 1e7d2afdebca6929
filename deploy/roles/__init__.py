"""The roles that processes of a fleet have: a module each builds the settings of its role and runs it."""
