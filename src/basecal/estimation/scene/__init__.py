"""Cameras and bases from unknown points of a static scene, which several images show."""
