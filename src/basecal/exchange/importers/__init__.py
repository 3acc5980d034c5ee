"""What other programs' files say, read for a cell: a file and a line for each kind."""
