"""User programs (clause 6): written, put on the subject, run, and compared with a model."""
