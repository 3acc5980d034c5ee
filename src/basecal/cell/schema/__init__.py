"""Schema, reading and writing of `cell.yaml`."""
