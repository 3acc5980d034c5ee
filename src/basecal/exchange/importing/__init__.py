"""Common parts of imports: rows are paired with samples, and complete a cell and its recording."""
