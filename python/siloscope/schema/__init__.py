"""Files that are written and read back: a typed model each. Here the names and versions of the documents."""

ESTIMATE = "siloscope.estimate/1"
CALIBRATION = "siloscope.calibration/1"
CONTENT = "siloscope.content/1"
TRACK = "siloscope.track/1"
