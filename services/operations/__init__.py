"""The entry points that a worker runs: bytes in, bytes and JSON out; a file for each flow.

`services.contract.operations` names them; `services.contract` has what goes in and what comes back.
"""
