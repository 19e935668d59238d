"""Engine and Client: the members that they share, and where each runs a query."""
