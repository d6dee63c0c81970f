"""Operators for mutants of the virtual controller."""
