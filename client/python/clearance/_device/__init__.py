"""Queries from device memory to device memory."""
