"""Reports of flights as web pages that need nothing but themselves."""
