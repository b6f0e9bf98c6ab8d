"""How the assembly turns: attitude, rotation laws, principal axes, changes, and propagators."""
