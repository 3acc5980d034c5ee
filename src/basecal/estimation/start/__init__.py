"""A first value for every unknown, without a guess."""
