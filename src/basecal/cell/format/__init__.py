"""Text formats and file access of a cell: YAML with line numbers, paths inside a cell, atomic writing."""
