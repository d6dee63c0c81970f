"""pcap and pcapng: read as wire events, and written from them.

Law: no live capture; what is here needs a file and no link.
"""
