"""Operators for mutants of the reference client."""
