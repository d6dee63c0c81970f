"""What is done with results: gate, comparison and merge.

Nothing here runs a test or judges traffic.
"""
