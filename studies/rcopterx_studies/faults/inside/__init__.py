"""What Python imports at the start of every process of a fleet that flies faults."""
