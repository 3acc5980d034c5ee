"""A simulated cell that runs: arms that move in time, pictures when they are requested, faults by switch."""
