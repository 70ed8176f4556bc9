"""What goes in and what comes out: frozen types that carry their evidence."""
