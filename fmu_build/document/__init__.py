"""What an FMU carries beside its library: page, pictures, licences, a reference result."""
