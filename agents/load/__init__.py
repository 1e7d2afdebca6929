"""Pace of control periods, and what is left out while the computer cannot keep up."""
