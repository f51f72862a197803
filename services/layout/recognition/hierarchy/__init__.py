"""Recognition with many models: coarse to fine, by genre (dissertation 5.7)."""

from services.layout.recognition.hierarchy.descent import (
    MOST_CANDIDATES,
    Competitor,
    Hierarchy,
    ModelRanking,
    rank_models,
)

__all__ = ["MOST_CANDIDATES", "Competitor", "Hierarchy", "ModelRanking", "rank_models"]
