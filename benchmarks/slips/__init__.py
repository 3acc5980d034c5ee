"""Slips that people make with their files, played through the command line."""
