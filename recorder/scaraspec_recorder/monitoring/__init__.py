"""Watching: what recordings are doing, for people and for other programs.

Law: read only; no recording is asked, waited for or changed.
"""
