"""Whether the input was given in other conventions, units or pairings than stated."""
