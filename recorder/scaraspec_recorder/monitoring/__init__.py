"""Shows the state of recordings: terminal dashboard, log lines and Prometheus metrics.

Read-only: this package does not send requests to a recording, wait for it or change it.
"""
