"""Requests to an agent and their answers, and programs outside that fly its vehicle."""
