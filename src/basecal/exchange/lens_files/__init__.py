"""Readers of lens files of other programs, with their pixel origins and distortion models."""
