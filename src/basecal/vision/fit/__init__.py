"""Fits of parametric shapes to image patches."""
