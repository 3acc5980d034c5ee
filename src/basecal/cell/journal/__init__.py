"""`recording/samples.jsonl`: read, checked and appended to."""
