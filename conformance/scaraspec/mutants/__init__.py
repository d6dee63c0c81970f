"""Mutants: controllers and clients that are wrong on purpose, and the cases that kill them.

A mutant changes one behaviour and leaves the rest as it is. No mutant is used outside of `prove`,
and of the options of the virtual controller and the reference client that name one.
"""
