"""The command line: arguments only, and the one place that joins all rooms."""
