"""Where to hang a camera: the deviations to expect, before anything is mounted."""
