"""The scheme of the paper, as the baseline: one linearized model, one quadratic program for all axes."""
