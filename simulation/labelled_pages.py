"""Pages with the truth of their zones, for tests and examples of layout structure recognition.

Letters, memos, fax sheets and the title pages of three invented publications, and the pages that follow the first
one; the generator of random numbers decides what stands on a page and where. The labels are those that people give
such pages. A page that is not drawn has the very zones of the drawn one.
"""

from simulation.continuation_pages import (
    DocumentKind,
    document_pages,
    letter_continuation,
    memo_continuation,
    paper_continuation,
)
from simulation.correspondence_pages import fax_page, letter_page, memo_page
from simulation.labelled_zones import LabelledPage, LabelledZone
from simulation.title_pages import Journal, title_page

__all__ = [
    "DocumentKind",
    "Journal",
    "LabelledPage",
    "LabelledZone",
    "document_pages",
    "fax_page",
    "letter_continuation",
    "letter_page",
    "memo_continuation",
    "memo_page",
    "paper_continuation",
    "title_page",
]
