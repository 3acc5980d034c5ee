"""A study of many points as text and as a page; computes nothing."""
