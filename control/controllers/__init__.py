"""Interchangeable controllers: from an estimate and a reference to inputs and a plan."""
