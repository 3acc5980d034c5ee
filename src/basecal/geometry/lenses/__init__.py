"""Lens models, a module each, with the face of `basecal.geometry.lens.Lens`.

A new one is a module here and a line in `registry`.
"""
