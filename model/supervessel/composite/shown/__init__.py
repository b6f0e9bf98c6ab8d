"""What outputs show of points and docks, in CasADi symbols."""
