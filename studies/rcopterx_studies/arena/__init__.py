"""The arena: schemes of distributed control on the same tasks."""
