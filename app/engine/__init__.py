"""Where work runs: the seam (`base`), and its local default, a pool of processes (`local`, `worker`)."""
