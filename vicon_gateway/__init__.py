"""Motion capture to poses: a Vicon DataStream client of our own, other brands through `motioncapture`."""
