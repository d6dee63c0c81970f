"""Drawing: a recording as a picture, in a file or in a viewer.

Law: a convenience, never the truth, and an optional extra: whatever fails here costs no recording.
"""
