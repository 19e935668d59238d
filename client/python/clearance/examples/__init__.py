"""Programs to start from, each of which is short enough to read at once: python -m clearance.examples"""
