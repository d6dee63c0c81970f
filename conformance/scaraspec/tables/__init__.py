"""Tables: the traffic of captures as rows, for spreadsheets, data frames and databases.

Belongs here: the schema of the tables, the rows of one capture, and the files that hold them. Does
not belong here: reading captures, judging them, and what is printed for people.
"""
