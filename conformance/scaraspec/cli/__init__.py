"""The command line: arguments, help, progress and signals; `scaraspec.api` does the work."""
