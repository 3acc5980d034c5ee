"""Calibration of a folder of cells, sequentially or in parallel: a row for each cell, also if it fails."""
