"""The figures of the paper and the manoeuvre table, one command each."""
