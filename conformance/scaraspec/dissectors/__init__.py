"""Dissectors: the protocol in the tools of others, generated from the command table.

Belongs here: the dissector for Wireshark and where it is installed, and the layer for scapy. Does
not belong here: reading captures, judging them, and what is printed for people.
"""
