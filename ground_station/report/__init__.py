"""Reports of flights as self-contained web pages."""
