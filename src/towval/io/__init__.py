"""The only code that touches files: campaign, video, MCAP, figures, report."""
