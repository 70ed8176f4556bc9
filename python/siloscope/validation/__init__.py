"""Is what a calibration states true? Cross-validation on a user's own frames."""
