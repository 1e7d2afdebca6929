"""The web page of a running fleet: scene, rows, steering, weights, plots, events. Needs websockets."""
