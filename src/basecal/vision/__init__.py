"""Rendering and detection of targets in images. The only package that imports OpenCV."""
