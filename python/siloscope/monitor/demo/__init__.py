"""A simulated farm: the newcomer's first look, and what the page is tested with."""
