"""Text as people write it: YAML with lines, problems listed at once, paths inside a cell."""
