"""Judge: whether what happened on the wire conforms to the document.

The catalogue of requirements, the rules, the verdicts, and the detection of dialects. What happened
is found out in `scaraspec.traffic`. Nothing here does any I/O.
"""
