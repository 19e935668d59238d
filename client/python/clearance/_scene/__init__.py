"""Scenes in this process."""
