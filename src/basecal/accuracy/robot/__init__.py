"""The robots' own joints and links."""
