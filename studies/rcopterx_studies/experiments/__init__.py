"""The figures of the paper, one command."""
