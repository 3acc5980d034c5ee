"""Recordings of hand-eye programs, each by its own convention of poses."""
