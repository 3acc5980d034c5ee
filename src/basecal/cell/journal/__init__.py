"""Reading, validation and appending of `recording/samples.jsonl`."""
