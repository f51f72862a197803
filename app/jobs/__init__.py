"""Long work that is accepted at once, and outlives the process that accepted it.

`stored_request` keeps a request and does it later. `registry` accepts, shows and cancels jobs. `running` runs them.
"""
