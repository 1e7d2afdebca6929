"""Published controllers and estimators, to compare with; they fly like any plug-in."""
