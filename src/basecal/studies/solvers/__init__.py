"""What a study may solve with, a file for each."""
