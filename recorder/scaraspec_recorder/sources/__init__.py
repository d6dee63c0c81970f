"""Sources: readers of captures (pcap, pcapng, MCAP) that give wire events, and TCP reassembly.

A source reads a file and opens no link. Does not belong here: decoding and judging.
"""
