"""Collects the cases of both roles: warm processes find them in the memory of their server.

The collection takes longer than most of what the tests of the command line do. Tests that start
`python -m scaraspec` collect the cases themselves.
"""

from scaraspec.report.model import Role
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import Options

for role in (Role.CONTROLLER, Role.CLIENT):
    collect(Options(), role)
