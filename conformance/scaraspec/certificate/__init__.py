"""Certificates: mandatory cases, the result package, and how it is verified.

Nothing here runs a case or judges traffic; `api/certificates.py` joins this with the audit.
"""
