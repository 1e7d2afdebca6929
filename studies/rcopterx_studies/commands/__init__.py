"""Commands that studies add to `rcopterx`."""
