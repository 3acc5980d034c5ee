"""What is told of a recording before anything is solved."""
