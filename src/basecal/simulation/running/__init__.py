"""A simulated cell that runs: arms that move in time, images when they are requested, faults by switch."""
