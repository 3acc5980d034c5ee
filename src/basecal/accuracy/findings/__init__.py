"""What a user should know of an answer: one file for each kind, registered in `registry`."""
