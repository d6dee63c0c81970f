"""Injects faults into frames, as a file of rules specifies.

Belongs here: rules, faults and the connection that applies them. The recording holds the bytes as
they were received; each change or delay is an extra record. Does not belong here: mutants of the
protocol behaviour (`scaraspec.mutants`).
"""
