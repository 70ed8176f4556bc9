"""The service's HTTP interface, one file a resource; routes call the store and pure functions only."""
