"""FMUs flown natively through an experiment, and what is kept of their flights by content."""
