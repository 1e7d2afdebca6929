"""What researchers compare and measure with `rcopterx`; none of it is needed to fly."""
