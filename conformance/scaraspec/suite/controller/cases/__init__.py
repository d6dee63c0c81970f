"""Cases for controllers, one file for each clause of the document; the suite plays the client.

A case is a test function with the decorator `case`; the report prints the first line of its
docstring. What several files need belongs in the package `harness`.
"""
