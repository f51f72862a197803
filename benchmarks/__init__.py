"""The dissertation's experiments again, peers side by side, speed and memory.

Data from outside the repository (flat pages, real photos) is looked for in `--data`, else in the environment
variable `DOCUMENT_DATA`, else in `../shared/data` beside the repository; where it is absent, pages of our own
are set instead.
"""
