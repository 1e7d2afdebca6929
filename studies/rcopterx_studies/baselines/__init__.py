"""Published controllers and the simplest estimator, to compare with; they fly like any plug-in."""
