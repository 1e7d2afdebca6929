"""Spare processes that replace a process that died in flight."""
