"""Robots with an OPC UA server: nodes of their joints or poses, and the session that reads them."""
