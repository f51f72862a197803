"""What is remembered of layout recognition: the only door to the database.

Every call is one short transaction, and may be made from any thread. Calls that write take their turn, on every
database: what one of them reads is what it changes.

**Versions** of a model count 1, 2, 3 and are never used again. Deleting a class drops its samples and what feedback
said of its pages at once (they are somebody's pages) and hides its versions; a class made anew under that name goes
on counting, and its history shows the earlier versions again. So a document never changes under its (name, version),
and may be cached by it.

**Feedback** is kept with the versions and the sample that it made, or not at all.
"""

from models.feedback_repository import KeptFeedback
from models.model_repository import KeptModels
from models.result_repository import KeptResults
from models.sample_repository import KeptSamples
from models.transactions import utc_now

__all__ = ["Store", "utc_now"]


class Store(KeptModels, KeptSamples, KeptFeedback, KeptResults):
    """Models, samples, feedback and results in one database; `with Store.open(...)` closes it."""
