"""Lens models; each is a module that implements `basecal.geometry.lens.Lens`.

To add a lens model, add a module here and a line in `registry`.
"""
