"""Measurements that verify the promises of a driver."""
