"""The spool: bounded hand-over of records from the tap process to the writer process.

Records go in, wire events come out. The spool survives the end of either process. Does not belong
here: the meaning of the bytes.
"""
