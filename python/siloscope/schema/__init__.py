"""Files that are written and read back, with the check of every field."""
