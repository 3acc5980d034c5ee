"""A study of many points as text, as a page and as charts in files; computes nothing."""
