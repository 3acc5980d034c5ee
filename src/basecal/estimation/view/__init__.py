"""What one view says of `camera_from_target`."""
