"""`python -m scaraspec` is the command `scaraspec`."""

from scaraspec.cli import main

main()
