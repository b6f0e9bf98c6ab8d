"""Docked vessels as one rigid body: the graph of docks, poses, masses and inertia tensors."""
