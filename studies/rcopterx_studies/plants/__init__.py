"""Plants of the simulated laboratory that need further libraries."""
