"""Bags of ROS: what is in them, what of it is taken, and where robots were when cameras looked."""
