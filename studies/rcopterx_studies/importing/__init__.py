"""Fleet files from files of other software."""
