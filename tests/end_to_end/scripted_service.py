"""The service with scripted operations, run as `python -m tests.end_to_end.scripted_service`."""

if __name__ == "__main__":
    from app.main import create_app, serve
    from app.settings import Settings
    from tests.app.scripted import OPERATIONS

    settings = Settings()
    serve(create_app(settings, OPERATIONS), settings)
