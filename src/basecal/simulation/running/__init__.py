"""A simulated cell in continuous operation: arms that move in time, images on request, and optional faults."""
