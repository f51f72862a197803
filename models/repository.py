"""The store of layout recognition: the only interface to the database.

Every call is one short transaction, and every thread may call. On every database, transactions that write run one
after another: nothing changes between the reads and the writes of one of them.

**Versions** of a model are numbered 1, 2, 3, and no number is used twice. Deleting a class deletes its samples and the
feedback on its pages, since these are personal data, and hides its versions. A new class of the same name continues
the numbers, and its history shows the earlier versions. So the document of a (name, version) never changes, and
callers may cache it. Settings of a class are stored apart from its versions: a rollback does not change them.

**Feedback** is written in one transaction with the versions, the sample and the result that follow from it, if the
models still have the versions that it was computed from; else it is `VersionConflict`, and nothing is written. The same
key, or the same body on the same result, is answered as the first time. Feedback outlives its result. A sample made by
feedback gives way to a later feedback on the result, and to new ones when the class is full; posted ones stay.

**Unknown pages** are the newest ones for a limited time; one is deleted as soon as feedback names its class.

**The list of changes** gets its entries in the transactions that make the changes, from calls inside of `changes_by`.
"""

from models.camera_repository import CameraRepository
from models.feedback_repository import FeedbackRepository
from models.job_repository import JobRepository
from models.kept_page_repository import KeptPageRepository
from models.lesson_repository import LessonRepository
from models.model_repository import ModelRepository
from models.result_repository import ResultRepository
from models.review_repository import ReviewRepository, cursor_of
from models.sample_repository import SampleRepository
from models.shared_value_repository import SharedValueRepository
from models.transactions import Author, changes_by, utc_now
from models.upgrade_repository import UpgradeRepository
from models.upload_repository import UploadRepository

__all__ = ["Author", "Store", "changes_by", "cursor_of", "utc_now"]


class Store(
    ModelRepository,
    SampleRepository,
    FeedbackRepository,
    LessonRepository,
    ResultRepository,
    KeptPageRepository,
    ReviewRepository,
    JobRepository,
    CameraRepository,
    UploadRepository,
    SharedValueRepository,
    UpgradeRepository,
):
    """All that is stored, in one database. `with Store.open(...)` closes it."""
