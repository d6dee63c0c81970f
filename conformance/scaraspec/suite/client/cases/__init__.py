"""Cases for clients, one file for each clause; the suite plays the controller."""
