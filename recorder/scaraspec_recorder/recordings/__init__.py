"""Keeping: which files a recording consists of, when each begins and ends, and how long it stays.

Law: what is in a file is the affair of `mcap` and `drawing`.
"""
