"""Operators: functions and base classes from which mutants are made.

An operator changes one kind of behaviour: a reply, a request, a transfer, a program run. No mutant
is registered in this package.
"""
