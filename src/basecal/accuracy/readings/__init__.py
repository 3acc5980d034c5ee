"""One way to read a cell and its recording, and what others make of it."""
