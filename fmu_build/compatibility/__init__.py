"""Compatibility information of FMUs, as the FMI project asks of tools that export them."""
