"""Common slips of users with their files, through the command line."""
