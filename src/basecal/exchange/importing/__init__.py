"""Common parts of importers: pairing of rows with samples, and additions to a cell and its recording."""
