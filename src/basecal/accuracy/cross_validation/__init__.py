"""Prediction of held-out samples."""
