"""The paper's closed form."""
