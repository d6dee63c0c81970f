"""Certification of a client: the cases, and the harness in which the suite acts as the controller.

What both roles share is in `suite.engine`. The cases for a controller are in `suite.controller`.
"""
