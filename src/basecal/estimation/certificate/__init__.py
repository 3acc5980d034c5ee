"""Certificate of global optimality: a proof that no other rotations fit better."""
