"""The verdict in one word and one sentence, and numbers with the digits that their sigma justifies."""
