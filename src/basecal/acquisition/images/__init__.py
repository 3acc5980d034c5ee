"""Images of live cameras: taken as they come, each with the time of its exposure."""
