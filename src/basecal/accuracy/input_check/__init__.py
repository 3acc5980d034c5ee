"""Tests whether the input has other conventions, units or pairings than stated."""
