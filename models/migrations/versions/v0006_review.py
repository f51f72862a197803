"""Tables of the review queue and of the list of who changed what."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "layout_reviews",
        sa.Column("result_id", sa.String(length=26), nullable=False),
        sa.Column("gain", sa.Double(), nullable=False),
        sa.Column("confidence", sa.Double(), nullable=False),
        sa.Column("class_name", sa.String(length=200), nullable=True),
        sa.Column("zones", sa.Integer(), nullable=False),
        sa.Column("decision", sa.String(length=10), nullable=False),
        sa.Column("has_image", sa.Boolean(), nullable=False),
        sa.Column("is_skipped", sa.Boolean(), nullable=False),
        sa.Column("claim", sa.String(length=64), nullable=True),
        sa.Column("claimed_by", sa.String(length=200), nullable=True),
        sa.Column("claimed_until", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["result_id"],
            ["layout_results.id"],
            name=op.f("fk_layout_reviews_result_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("result_id", name=op.f("pk_layout_reviews")),
    )
    op.create_index(op.f("ix_layout_reviews_gain"), "layout_reviews", ["gain"])
    op.create_index(op.f("ix_layout_reviews_confidence"), "layout_reviews", ["confidence"])
    op.create_table(
        "layout_audit",
        sa.Column("id", sa.String(length=26), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("who", sa.String(length=200), nullable=True),
        sa.Column("action", sa.String(length=40), nullable=False),
        sa.Column("model", sa.String(length=200), nullable=True),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_layout_audit")),
    )
    op.create_index(op.f("ix_layout_audit_model"), "layout_audit", ["model"])
