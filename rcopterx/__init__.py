"""The command line `rcopterx` and the scripting interface."""
