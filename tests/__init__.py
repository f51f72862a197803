"""Tests of all that the repository holds."""

import os

from app.engine.worker import SINGLE_THREAD_ENVIRONMENT

# Before any library reads it: threads that two processes of tests start on two cores wait for each other, and a
# Cholesky decomposition took twenty times as long.
os.environ.update(SINGLE_THREAD_ENVIRONMENT)
