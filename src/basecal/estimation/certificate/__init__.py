"""A proof that no other rotations fit better."""
