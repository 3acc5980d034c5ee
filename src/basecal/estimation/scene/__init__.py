"""Cameras and bases from unknown points of a static scene, which several pictures show."""
