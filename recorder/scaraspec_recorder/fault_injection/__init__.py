"""Injection: faults on purpose, done to the frames that a file of rules means.

Law: recorded is what came in; what goes out changed or late is told beside it.
"""
