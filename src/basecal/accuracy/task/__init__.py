"""The error where the work is done: by source, and over the workspace."""
