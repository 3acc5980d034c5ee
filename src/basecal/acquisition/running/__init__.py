"""The running check of a capture: an estimate after each sample, and a test of the next sample against it."""
