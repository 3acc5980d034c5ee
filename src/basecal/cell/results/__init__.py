"""Files of the answer and of the truth: `calibration.json` and `truth.yaml`."""
