"""Long work that is accepted at once, and outlives the process that accepted it.

With `Prefer: respond-async` a route's work (`app.routes.long_work`) becomes a job: a row of the store with the name and
role of its key, and the body as a blob (`stored_request`). `registry` accepts, shows and cancels jobs. Who runs a job
(`running`) does the stored request through the same route, so its answer is that of the request, and keeps it. A lease
with a token is renewed meanwhile, and the end is written once: a late writer has another token. Jobs of a dead worker
are queued again, a limited number of times. What the service could not run is handed back, and is no attempt.

`dispatch` and, with PostgreSQL, `queue` wake slots; which job a slot takes is decided by the rows, so that owners take
turns. A service without workers stores every request for work as a job and waits for its answer (`forwarding`).
`following` and `changes` say who hears of what. `callbacks` tell clients' servers.
"""
