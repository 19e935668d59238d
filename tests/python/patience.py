"""How long tests wait for what must come: a stop for what never will, and no measure of anything. Machines are busy."""

PATIENCE_S = 300
