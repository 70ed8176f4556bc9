"""From one frame to an estimate: preparation, the two methods, the paper's steps."""
