"""Errors of the base and of a camera's mount beside today's practice, all from the same pixels."""
