"""Types of numbers, sigmas, poses and entries in files, and reports of their problems."""
