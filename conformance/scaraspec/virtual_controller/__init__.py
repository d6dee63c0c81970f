"""The virtual controller: a robot that exists as pure state and injected time, and its shell."""
