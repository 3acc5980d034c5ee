"""The cell as it stands, in three dimensions and as a still image."""
