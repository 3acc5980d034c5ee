"""What the first screen of a page decides by: numbers, charts with the tolerance, and what was checked."""
