"""Arms in processes of their own, and the process that stops them all at once."""
