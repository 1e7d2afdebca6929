"""Compiled kernels: arithmetic on small arrays that every control period repeats, as pure functions.

A kernel knows arrays and numbers, and nothing of vehicles, messages or processes; who calls it says what they
mean.
"""
