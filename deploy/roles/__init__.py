"""The roles of processes: each has a module, which builds the settings of the role and runs it."""
