"""The running check of a capture: an estimate after each sample, and samples that disagree with it."""
