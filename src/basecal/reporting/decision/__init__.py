"""Content of a page's first screen: numbers, charts with the tolerance, and passed checks."""
