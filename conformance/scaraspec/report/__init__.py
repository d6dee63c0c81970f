"""report: what was judged, written for a person or for another program.

`model` is the one truth, results.json; every other form is made from it and adds no judgement.
Nothing here opens a link, and what a subject sent is hostile text until a writer has made it safe.
"""
