"""Interchangeable controllers, one file each."""
