"""`python -m app` runs the service with the settings of the environment."""

if __name__ == "__main__":
    # Inside of the guard, because worker processes import this module too and need nothing of the app.
    from app.main import serve

    serve()
