"""Certificates of a fleet: who has one, where they lie, how they are issued and checked."""
