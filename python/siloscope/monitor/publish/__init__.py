"""Ways out of the service to other systems; each can be off."""
