"""Queries: their arguments, their calls and their results."""
