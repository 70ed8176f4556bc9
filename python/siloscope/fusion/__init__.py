"""From many frames to one pose and one silo: the frames' equations solved together."""
