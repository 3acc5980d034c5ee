"""Targets as shapes, and images of them."""
