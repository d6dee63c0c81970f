"""What happened on the wire, and whether it was right: pure functions over wire events."""
