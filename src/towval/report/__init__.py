"""What people look at: figures, the overlay video, the page."""
