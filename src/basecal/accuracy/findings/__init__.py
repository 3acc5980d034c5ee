"""What a solution's numbers say, as findings."""
