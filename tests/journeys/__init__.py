"""Whole ways of users, from their tools' raw files to a line that is pasted, by commands alone."""
