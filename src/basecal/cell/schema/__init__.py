"""`cell.yaml`: its shape, read and written."""
