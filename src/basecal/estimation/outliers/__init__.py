"""Detection of outlying views, stops and points."""
