"""Answers, once: workers build these models, the app writes them as JSON, and the OpenAPI document is made from them.

Lengths are pixels, angles degrees. What a form or a body of a request may have is in `app/schemas`.
"""
