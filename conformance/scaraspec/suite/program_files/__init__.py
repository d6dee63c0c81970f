"""User programs (clause 6): builds, uploads and runs them, and compares them with a model."""
