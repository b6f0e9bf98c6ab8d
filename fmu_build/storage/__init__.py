"""What is kept from one run to the next, and folders that last as long as a run."""
