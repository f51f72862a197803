"""The operations that workers run, by name. The server never imports the functions themselves."""

# ruff: noqa: RUF009 (an operation is a string, and immutable)

from dataclasses import dataclass, fields
from typing import Generic, TypeVar

from services.contract.answers.proposals import Proposals
from services.contract.images import PageReply
from services.contract.kept_pages import RenderedPage
from services.contract.layout import DocumentReply, LayoutReply, RenderedResults, StackReply
from services.contract.layout_learning import Adaptation, RevisedPage, TrainingReport
from services.contract.layout_models import MeasuredSample, ModelDifference, ModelDraft
from services.contract.page_json import SampleJson
from services.contract.result_json import RecognitionJson, ResultJson
from services.contract.worker_facts import WorkerFacts

T = TypeVar("T")


class Operation(str, Generic[T]):
    """The name "module:function" of a function that returns a `T`. A worker imports the module and calls it."""

    __slots__ = ()

    @property
    def module(self) -> str:
        """The part before the colon."""
        return self.partition(":")[0]


@dataclass(frozen=True, slots=True)
class Operations:
    """The operations of one service; a test can replace them. An operation has the arguments of its function."""

    rectify: Operation[PageReply] = Operation("services.operations.rectify_documents:rectify_uploads")
    render_kept_page: Operation[tuple[PageReply, RenderedPage]] = Operation(
        "services.operations.kept_pages:render_kept_page"
    )
    bind_kept_pages: Operation[PageReply] = Operation("services.operations.kept_pages:bind_kept_pages")
    show_kept_photo: Operation[bytes] = Operation("services.operations.kept_pages:show_kept_photo")
    bind_done_pages: Operation[PageReply] = Operation("services.operations.rectify_documents:bind_done_pages")
    mosaic: Operation[PageReply] = Operation("services.operations.mosaic:mosaic_uploads")
    recognize_layout: Operation[LayoutReply | DocumentReply | StackReply] = Operation(
        "services.operations.layout_documents:recognize_uploads"
    )
    resize_kept_picture: Operation[bytes] = Operation("services.operations.kept_picture:resize_kept_picture")
    render_results: Operation[RenderedResults] = Operation("services.operations.layout_files:render_results")
    measure_sample: Operation[SampleJson] = Operation("services.operations.layout_models:measure_sample")
    measure_sample_file: Operation[MeasuredSample] = Operation(
        "services.operations.layout_models:measure_sample_file"
    )
    remeasure_sample: Operation[SampleJson] = Operation("services.operations.layout_models:remeasure_sample")
    import_sample: Operation[SampleJson] = Operation("services.operations.layout_models:import_sample")
    initialize_model: Operation[ModelDraft] = Operation(
        "services.operations.layout_models:initialize_from_samples"
    )
    import_model: Operation[ModelDraft] = Operation("services.operations.layout_models:import_model")
    recognize_again: Operation[RecognitionJson] = Operation(
        "services.operations.layout_again:recognize_again"
    )
    adapt_models: Operation[Adaptation] = Operation("services.operations.layout_learning:adapt_models")
    revise_page: Operation[RevisedPage] = Operation("services.operations.layout_learning:revise_page")
    correct_result: Operation[ResultJson] = Operation("services.operations.corrected_result:correct_result")
    train_model: Operation[tuple[ModelDraft, TrainingReport]] = Operation(
        "services.operations.layout_learning:train_model"
    )
    compare_models: Operation[ModelDifference] = Operation("services.operations.layout_diff:compare_models")
    propose_classes: Operation[Proposals] = Operation("services.operations.layout_discovery:propose_classes")
    warm_up: Operation[WorkerFacts] = Operation("services.operations.warming:warm_up")

    @property
    def modules(self) -> list[str]:
        """The modules of all operations. The first worker starts after they were imported once."""
        return sorted({getattr(self, field.name).module for field in fields(self)})
