"""The cascade, the default controller: heading first, then height and the horizontal motion."""
