"""Text as people write it: YAML with lines, problems told at once, paths inside a cell."""
