"""What recordings mean, one module for everyone who writes them."""
