"""The runner: a simulation worker that reaches only the API.

Nothing here needs a database, a broker or an artifact store, nor loads what connects to them.
"""
