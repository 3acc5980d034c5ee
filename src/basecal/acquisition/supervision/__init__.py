"""Arms in separate processes, and the process that stops them together."""
