"""The web page of a running fleet: 3-D scene, steering, weights, plots, events. Needs viser."""
