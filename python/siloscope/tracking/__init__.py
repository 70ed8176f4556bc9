"""What many readings of one silo tell: events, daily use, tables and a page."""
