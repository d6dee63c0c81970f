"""capture.mcap: written, read and mended.

Law: one file at a time. When files begin and end, and which are kept, stands in `keeping`.
"""
