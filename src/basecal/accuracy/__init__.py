"""The quality of a solution: its fit, its findings, its verdict."""
