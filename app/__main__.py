"""`python -m app` runs the service with the settings of the environment; `python -m app worker` only runs its jobs.

`python -m app remeasure [CLASS...]` measures samples with images again and makes a new version of each model.
"""

import sys

if __name__ == "__main__":
    # Inside the guard: worker processes import this module too, and must not load the app.
    from app.main import serve, work

    if sys.argv[1:] == ["worker"]:
        work()
    elif sys.argv[1:2] == ["remeasure"]:
        from app.learning.remeasuring import remeasure

        sys.exit(remeasure(sys.argv[2:]))
    elif not sys.argv[1:]:
        serve()
    else:
        sys.exit("usage: python -m app [worker | remeasure [CLASS...]]")
