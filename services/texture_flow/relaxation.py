"""Relaxation labelling over a grid of candidate directions (dissertation 2.3.2, after Hummel and Zucker)."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats

NEIGHBOURS = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)]


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """K candidate directions at every node of a grid.

    `angles` (rows, columns, K) rad, `energies` (rows, columns, K), zero where there is no candidate.
    """

    angles: Floats
    energies: Floats


def find_peaks(energies: Floats, angles: Floats, count: int) -> Candidates:
    """The `count` highest local maxima of cyclic curves `energies` (rows, columns, A) over `angles` (A,).

    Peaks are refined by a parabola through their neighbours; missing ones have energy 0.
    """
    left, right = np.roll(energies, 1, axis=-1), np.roll(energies, -1, axis=-1)
    is_peak = (energies >= left) & (energies > right) & (energies > 0)
    order = np.argsort(np.where(is_peak, -energies, np.inf), axis=-1)[..., :count]

    def pick(values: Floats) -> Floats:
        return np.asarray(np.take_along_axis(values, order, axis=-1))

    curvature = pick(left) - 2 * pick(energies) + pick(right)
    shift = np.where(
        curvature < 0, 0.5 * (pick(left) - pick(right)) / np.where(curvature < 0, curvature, -1), 0
    )
    step = angles[1] - angles[0]
    refined = (angles[order] + np.clip(shift, -0.5, 0.5) * step) % np.pi
    found = np.take_along_axis(is_peak, order, axis=-1)
    return Candidates(refined, np.where(found, pick(energies), 0.0))


def _shifted(values: Floats, down: int, right: int) -> Floats:
    """`values` shifted by whole nodes, zero at the new border."""
    rows, columns = values.shape[:2]
    moved = np.zeros_like(values)
    to_r = slice(max(down, 0), rows + min(down, 0))
    to_c = slice(max(right, 0), columns + min(right, 0))
    from_r = slice(max(-down, 0), rows + min(-down, 0))
    from_c = slice(max(-right, 0), columns + min(-right, 0))
    moved[to_r, to_c] = values[from_r, from_c]
    return moved


def label_by_relaxation(candidates: Candidates, iterations: int) -> Floats:
    """Confidence (rows, columns, K) of every candidate after the exchange of support with 8 neighbours.

    C_ik(0) = E_ik / max_k E_ik;  r_ij(k1, k2) = cos(Gamma(a_ik1, a_jk2)) = |cos(a_ik1 - a_jk2)|;
    s_ik = sum_j sum_k2 r_ij(k, k2) C_jk2;  C <- C (1 + s), normalised to sum 1 over k.

    The dissertation adds the support itself. Multiplied by C (Hummel and Zucker's form), a candidate keeps the share
    given by its energy; else many weak candidates would even it out. Absent candidates stay at 0, so that they neither
    give nor get support.
    """
    present = candidates.energies > 0
    top = candidates.energies.max(axis=-1, keepdims=True)
    confidence = np.where(present, candidates.energies / np.where(top > 0, top, 1.0), 0.0)
    cos, sin = np.cos(candidates.angles), np.sin(candidates.angles)
    compatibility = np.concatenate(
        [
            np.abs(
                cos[..., :, None] * _shifted(cos, down, right)[..., None, :]
                + sin[..., :, None] * _shifted(sin, down, right)[..., None, :]
            )
            for down, right in NEIGHBOURS
        ],
        axis=-1,
    )
    for _ in range(iterations):
        others = np.concatenate([_shifted(confidence, down, right) for down, right in NEIGHBOURS], axis=-1)
        support = (compatibility @ others[..., None])[..., 0]
        confidence = np.where(present, confidence + support * confidence, 0.0)
        total = confidence.sum(axis=-1, keepdims=True)
        confidence = confidence / np.where(total > 0, total, 1.0)
    return confidence
