"""Forwarding: how bytes get from client to robot and back, and how the recorder gets in between.

Law: forward first. Nothing here waits for what is recorded, or knows what it means.
"""
