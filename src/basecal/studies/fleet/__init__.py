"""A folder of cells calibrated, one after another or side by side: a row for each, whatever is wrong with it."""
