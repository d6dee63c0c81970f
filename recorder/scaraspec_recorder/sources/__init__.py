"""Sources: readers of captures (pcap, pcapng, MCAP) that give wire events, and TCP reassembly.

A source needs a file and no link. What a capture means is found out elsewhere.
"""
