"""Importers of other programs' files: a file and a line for each kind."""
