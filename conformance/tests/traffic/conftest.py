"""Fixtures of the traffic tests."""

from traffic_notation import check_case, judged, recut, script

__all__ = ["check_case", "judged", "recut", "script"]
