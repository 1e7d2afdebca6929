"""Subcommands of `rcopterx`, by theme."""
