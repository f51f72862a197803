"""`python -m app` runs the service with the settings of the environment."""

if __name__ == "__main__":
    # Inside the guard: worker processes import this module too, and must not load the app.
    from app.main import serve

    serve()
