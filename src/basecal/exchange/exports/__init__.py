"""Common parts of exporters: the chosen transforms, their digits, and their source."""
