"""Judge: whether what happened on the wire conforms to the document.

It has the catalogue of requirements, the rules, the verdicts, and the detection of dialects.
`scaraspec.traffic` determines what happened. This package does no I/O.
"""
