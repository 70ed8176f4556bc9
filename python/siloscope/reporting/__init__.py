"""Results for people: pictures, pages, files, and the demo."""
