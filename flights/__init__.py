"""Flight logs: everything that travels on the bus, in MCAP files; written, listed, read, mended, exported."""
