"""The interface of an FMU: variable table, modelDescription.xml, units, terminals and icons."""
