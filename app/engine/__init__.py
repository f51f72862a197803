"""Where work runs: the seam (`base`), and its local default, a pool of processes (`local`, `worker`).

A worker that crashes, hangs or asks for too much memory costs one request. What an upload spools is read only when a
worker is free. Progress that `services` report comes through the worker's pipe before the answer.
"""
