"""Interchangeable estimators, one file each."""
