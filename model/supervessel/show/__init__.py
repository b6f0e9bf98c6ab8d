"""What a scene amounts to at its start, looked at before anything is built."""
