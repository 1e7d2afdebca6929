"""The channel table, the messages and the sessions every process talks through."""
