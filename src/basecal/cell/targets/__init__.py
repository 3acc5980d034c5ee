"""Kinds of targets, one module each: entry in `cell.yaml`, points, printed sheets and detector.

A new kind needs a module here that defines `KIND`, and a name and a line in `registry`.
"""
