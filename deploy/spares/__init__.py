"""Spare processes: warm processes that replace those that die."""
