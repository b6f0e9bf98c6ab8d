"""The C code of a scene, and the files that its FMU is compiled from."""
