"""What is reported a recording before anything is solved."""
