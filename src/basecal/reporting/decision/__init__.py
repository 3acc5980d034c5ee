"""Content of the first screen of a page: numbers, charts with the tolerance, and passed checks."""
