"""Asynchronous recordings with one clock per device: robot paths are interpolated at the times of the views."""
