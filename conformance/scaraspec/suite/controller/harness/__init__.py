"""The harness in which the suite acts as the client of a controller under test."""
