"""Connections to controllers: whether they can be made, and how they are made again."""
