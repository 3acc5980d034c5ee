"""Runs of a cell to look through on a local page: samples one by one, and what comes out without some of them."""
