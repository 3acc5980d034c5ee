"""Descriptions of estimation results that several findings share."""
