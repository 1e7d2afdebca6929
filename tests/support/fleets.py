"""Fleet files for tests."""

PAIR = """
name = "lab"

[simulator]

[vehicles.h1]
subject = "heli1"
transmitter = { port = "radio-h1", model_match = 1 }

[vehicles.h2]
subject = "heli2"
transmitter = { port = "radio-h2", model_match = 2 }
follow = [{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }]
"""
"""A leader and a follower in the simulator; `h2` is the last table, so lines can be added to it."""

HARDWARE_PAIR = PAIR.replace("[simulator]\n", "")
