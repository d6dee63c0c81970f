"""Archive: the tables of many captures in one store, as Parquet files that are queried with SQL.

Belongs here: the files of a store, its views, queries and report. Does not belong here: judging the
captures, which `scaraspec.api.archives` does.
"""
