"""The scripting interface of a fleet and its vehicles."""
