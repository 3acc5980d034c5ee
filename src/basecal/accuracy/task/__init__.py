"""Expected error at the task: its sources, and its map over the workspace."""
