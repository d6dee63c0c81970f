"""The cases against a controller, one file per clause of the document."""
