"""What a solution is worth: its fit, its findings, its verdict."""
