"""The fleet file: its types, reading and checking it, and the files that come with the package."""
