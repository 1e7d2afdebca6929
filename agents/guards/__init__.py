"""Time limits and checks around controllers and estimators, which may be plug-ins."""
