"""Starting, logging and restarting the processes of one host."""
