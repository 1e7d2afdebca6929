"""Separation from other vehicles: whose plans are needed, and which of them constrain the own one."""
