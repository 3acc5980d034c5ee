"""Kinds of targets, a module each: its entry in `cell.yaml`, its points, what is printed, how it is found.

A new kind is a new module here that ends in a `KIND`, and a name and a line in `registry`.
"""
