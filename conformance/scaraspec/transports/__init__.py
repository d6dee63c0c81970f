"""Links: the client's end of a byte stream to a controller, over whatever carries it."""
