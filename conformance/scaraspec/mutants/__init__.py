"""Mutants: controllers and clients that are wrong on purpose, and the cases that kill them.

A mutant changes one behaviour and leaves the rest as it is. Mutants are used by `prove`, by the
calibration before a certification, and by ``scaraspec controller --mutant``; `requirements` lists
them. `recorded_runs` runs the suite against the conforming implementations, for the case sheets.
"""
