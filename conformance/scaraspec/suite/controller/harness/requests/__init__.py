"""Requests: functions that send requests and check their replies, one module per topic."""
