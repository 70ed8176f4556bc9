"""What the service keeps: the only place with SQL. One file a concern."""
