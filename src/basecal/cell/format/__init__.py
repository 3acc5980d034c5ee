"""Files of a cell: paths, YAML, results and truth."""
