"""Files of results and ground truth, such as `calibration.json` and `truth.yaml`."""
