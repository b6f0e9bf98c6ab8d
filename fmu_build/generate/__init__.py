"""C that is particular to a scene, and the files that an FMU is compiled from."""
