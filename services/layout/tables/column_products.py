"""Columns of numbers of which one is the product of two others, as price times quantity is the amount.

Which labels do so is learned from samples, so that it needs neither their names nor a language; on a page of another
firm it tells which columns they are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from services.layout.tables.cell_numbers import number_of
from services.layout.tables.column_evidence import Assignment, PrintedColumn, assign_columns
from services.layout.tables.table_model import MOST_PRODUCTS, ProductRule, TableModel

MOST_COLUMNS = 8
"""Columns of numbers of a page that are tried as factors: all triples of them."""
_TOLERANCE = Decimal("0.02")
"""Of a product, in its unit: prices are rounded."""
_RELATIVE = Decimal("0.0005")
_LEAST_TESTED = 2.0
_LEAST_FITS = 0.7
"""Share of the tested rows of the samples, and of a page, of which a rule holds."""
_A_ROW = 4.0
_MOST_GAIN = 14.0
"""Log odds that columns whose numbers fit are those of the rule: of one row, and of all. That three other numbers of a
row fit to the cent is rare, and that they do in several rows rarer."""


def fits_product(one: Decimal, other: Decimal, product: Decimal) -> bool:
    """Whether the third number is the product of the others, but for rounding."""
    return abs(one * other - product) <= max(_TOLERANCE, abs(product) * _RELATIVE)


def tests_product(one: Decimal | None, other: Decimal | None, product: Decimal | None) -> bool:
    """Whether three numbers can tell: all are known, and no factor is 1 or 0."""
    return product is not None and all(each is not None and each not in (0, 1) for each in (one, other))


def row_fits(rule: ProductRule | None, row: Mapping[str, str], discount: str = "") -> bool | None:
    """Whether the numbers of a row (texts by label) are factors and product of a rule; None where they cannot tell.

    `discount` is the text of a discount in percent. That one times a price is the price confirms nothing; that it is
    another amount is wrong.
    """
    if rule is None:
        return None
    of, by, gives = (number_of(row.get(label, "")) for label in (rule.of, rule.by, rule.gives))
    if of is None or by is None or gives is None:
        return None
    less = number_of(discount) or Decimal(0)
    fits = fits_product(of * (100 - less) / 100, by, gives)
    return fits if tests_product(of, by, gives) or not fits else None


def product_rule(model: TableModel) -> ProductRule | None:
    """The rule that holds of the most rows of the samples; None where none holds of nearly all."""
    held = [
        rule
        for rule in model.products
        if rule.tested >= _LEAST_TESTED and rule.fits >= _LEAST_FITS * rule.tested
    ]
    return max(held, key=lambda rule: rule.fits, default=None)


def count_products(
    rows: Sequence[Mapping[str, str]], labels: Sequence[str], known: Sequence[ProductRule]
) -> tuple[ProductRule, ...]:
    """The rules after so many rows more (texts by label); those of which no row fits are left out."""
    rules = {(rule.of, rule.by, rule.gives): (rule.tested, rule.fits) for rule in known}
    numbers = [{label: number_of(text) for label, text in row.items()} for row in rows]
    for of, by, gives in permutations(labels, 3):
        if of > by:
            continue
        tested, fits = rules.get((of, by, gives), (0.0, 0.0))
        for row in numbers:
            one, other, product = row.get(of), row.get(by), row.get(gives)
            if one is None or other is None or product is None or not tests_product(one, other, product):
                continue
            tested += 1
            fits += fits_product(one, other, product)
        if fits:
            rules[of, by, gives] = tested, fits
    kept = sorted(rules.items(), key=lambda rule: (-rule[1][1], rule[0]))[:MOST_PRODUCTS]
    return tuple(ProductRule(*key, *counts) for key, counts in sorted(kept))


def with_products(
    model: TableModel, found: Assignment, scores: NDArray[np.float64], columns: Sequence[PrintedColumn]
) -> Assignment:
    """The assignment in which the columns of the samples' rule are those whose numbers fit it, if any do.

    A column of numbers without a label may be a discount in percent.
    """
    rule = product_rule(model)
    if rule is None:
        return found
    labels = (rule.of, rule.by, rule.gives)
    numbers = _numbers(columns)
    usable = [place for place in range(len(columns)) if _is_usable(numbers[place])][:MOST_COLUMNS]
    chosen = [found.places.get(label) for label in labels]
    best, most = found, found.score
    if all(place in usable for place in chosen):
        gain, discount = _gain(numbers, tuple(place for place in chosen if place is not None), usable)
        best, most = replace(found, discount=discount), found.score + gain
    for places in permutations(usable, 3):
        gain, discount = _gain(numbers, places, usable)
        if not gain:
            continue
        tried = assign_columns(model, scores, dict(zip(labels, places, strict=True)))
        if tried.score + gain > most:
            best, most = replace(tried, discount=discount), tried.score + gain
    return replace(best, score=most)


def _numbers(columns: Sequence[PrintedColumn]) -> NDArray[np.float64]:
    """The numbers (C, R) of the cells of columns, NaN where a cell has none."""
    read = [[number_of(text) for text in column.cells] for column in columns]
    return np.array([[np.nan if each is None else float(each) for each in own] for own in read]).reshape(
        len(columns), -1
    )


def _is_usable(numbers: NDArray[np.float64]) -> bool:
    return bool(np.isfinite(numbers).sum() > 0.5 * len(numbers))


def _gain(
    numbers: NDArray[np.float64], places: Sequence[int], usable: Sequence[int]
) -> tuple[float, int | None]:
    """Log odds that three columns are factors and product, 0 where they do not fit, and the column of a discount."""
    one, other, product = numbers[list(places)]
    tests = np.isfinite(one * other * product) & (one != 1) & (other != 1) & (one != 0) & (other != 0)
    count = int(tests.sum())
    if not count:
        return 0.0, None
    for discount in (None, *(place for place in usable if place not in places)):
        share = 1.0
        if discount is not None:
            percent = numbers[discount]
            if not ((percent >= 0) & (percent < 100) & (percent == np.round(percent)))[tests].all():
                continue
            share = 1.0 - percent / 100.0
        away = np.abs(one * other * share - product)
        fits = int(
            (away[tests] <= np.maximum(float(_TOLERANCE), float(_RELATIVE) * np.abs(product[tests]))).sum()
        )
        if fits >= _LEAST_FITS * count:
            return min(_MOST_GAIN, _A_ROW * fits), discount
    return 0.0, None
