"""Detection of processes that make no progress."""
