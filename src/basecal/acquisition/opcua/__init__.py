"""Robots that answer OPC UA: which nodes hold their joints or poses, and what is read of them."""
