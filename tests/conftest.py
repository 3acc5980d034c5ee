"""Here, so that tests of every folder may `from derivatives import ...`."""
