"""What is done with results: gate and comparison. Nothing here runs a test or judges traffic."""
