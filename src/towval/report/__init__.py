"""Output for readers: figures, the overlay video, the page."""
