"""`python -m scaraspec` is the command `scaraspec`."""

from scaraspec.cli.main import main

main()
