"""What importers see of an FMU: its variables, their description in XML, terminals and icons."""
