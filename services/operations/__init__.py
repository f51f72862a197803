"""The functions that a worker runs: they take bytes and return bytes and JSON. Each flow has a module.

`services.contract.operations` has their names, `services.contract` the types of their arguments and results.
"""
