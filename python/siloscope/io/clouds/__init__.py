"""Point clouds, one module a format."""
