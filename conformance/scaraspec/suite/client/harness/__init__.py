"""The suite in the role of the controller: access to the client, connections, checks of requests.

The cases are in `suite.client.cases`. This package sends and checks, but decides no test sequence.
"""
