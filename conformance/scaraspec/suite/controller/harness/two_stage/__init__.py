"""Two stages: commands that go on behind their first reply, and what holds meanwhile."""
