"""Engine: the parts of the suite that do not depend on the role of the system under test."""
