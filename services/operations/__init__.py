"""The functions that a worker runs: they take bytes and return bytes and JSON. Each flow has a module.

`services.contract.operations` has their names, `services.contract` the types of their arguments and results. Workers
never touch the store: the app hands models and samples in as documents, and stores what comes back. A version of a
model never changes, so workers keep models that they have read (`stored_models`).
"""
