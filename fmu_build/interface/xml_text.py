"""The text of an XML file of an FMU."""

from xml.etree import ElementTree as ET


def xml_text(root: ET.Element) -> bytes:
    """Returns an indented document in UTF-8; `root` gets indented."""
    ET.indent(root, "  ")
    text = ET.tostring(root, encoding="unicode")  # written as bytes it takes twice the time
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{text}\n".encode()
