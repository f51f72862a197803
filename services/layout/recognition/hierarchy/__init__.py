"""Recognition with many models: coarse to fine, by genre (dissertation 5.7).

A genre is one that users have named, or a group of models whose zones are alike (`likeness`); its model is pooled from
those of its classes (`pooling`). A page gets unary scores by all genres, then by the models of the likely ones: every
zone takes its cheapest label, for all models in one array (`bank`). The cost of that labelling, pairs and counts
included, ranks the models, and the best are matched (`descent`). A class that is left out is in the answer with its
unary score or that of its genre. A new version of one model makes its genre anew.
"""

from services.layout.recognition.hierarchy.descent import (
    MOST_CANDIDATES,
    Competitor,
    Hierarchy,
    ModelRanking,
    rank_models,
)

__all__ = ["MOST_CANDIDATES", "Competitor", "Hierarchy", "ModelRanking", "rank_models"]
