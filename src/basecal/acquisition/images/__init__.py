"""Images of live cameras, read continuously, with their times of exposure."""
