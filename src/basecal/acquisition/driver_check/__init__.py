"""What a driver promises, measured."""
