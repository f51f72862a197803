"""Photos and their analyses that several tests look at; each is taken once."""

from hypothesis import settings

# The time of one example says nothing on a busy machine; the same examples run every time.
settings.register_profile("laws", deadline=None, derandomize=True)
settings.load_profile("laws")
