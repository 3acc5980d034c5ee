"""A UR controller over its network: states it sends, and the program it runs for moves."""
