"""Recordings of cells as they run: drivers, waiting for stillness, going through a pattern."""
