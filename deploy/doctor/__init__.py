"""Checks of `rcopterx doctor`: permissions, certificates, and what a running fleet refuses."""
