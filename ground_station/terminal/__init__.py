"""Tables, margins, logs and scenarios for the terminal."""
