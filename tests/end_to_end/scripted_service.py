"""The service with scripted operations, run as `python -m tests.end_to_end.scripted_service [worker]`."""

import sys

if __name__ == "__main__":
    from app.main import create_app, serve, work
    from app.settings import Settings
    from tests.app.scripted import OPERATIONS

    settings = Settings()
    run = work if sys.argv[1:] == ["worker"] else serve
    run(create_app(settings, OPERATIONS), settings)
