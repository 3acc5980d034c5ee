"""Covariance of an answer beyond its linear theory: another answer that it covers, arcs that leave their tangents."""
