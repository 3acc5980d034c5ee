"""Common parts of exporters: choice of transforms, their digits and their source."""
