"""What came out and what is so: `calibration.json` and `truth.yaml`."""
