"""Network interface of a UR controller: its states, and its program for moves."""
