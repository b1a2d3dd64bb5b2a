"""Intervals of Table 1 for one dataset: how far the entropies would differ with other photons.

Notation: G groups of photons; H the entropy of all photons; H_g that of all photons but those of group g.
"""

from collections.abc import Iterator

import numpy as np

from pcii.evaluation.summary import mean_interval
from pcii.imaging.bright_regions import box_around
from pcii.metrics.scoring import entropy_region
from pcii.sections.photon_statistics import (
    pooled_estimate,
    pooled_samples,
    region_entropy_bits,
    section_window_px,
)
from pcii.sections.reconstruction import reconstruct
from pcii.types.photon_counts import PhotonCounts
from pcii.types.section_stack import Sections
from pcii.types.truth import Truth

GROUPS = 10
"""Intervals of so few pseudo-values are 15 % longer than those of many, and take a fraction of the time."""
MOST_EVENTS = 5_000_000
"""With more pixels that have photons, intervals are narrower than the digits that are shown."""


def entropy_half_widths(
    counts: PhotonCounts, sections: Sections, truth: Truth, seed: int = 0
) -> list[dict[str, float]]:
    """Half the 95 % interval of each entropy in `Score.objects`, in bits, by depth spelled as there.

    A jackknife over photons (Quenouille 1956; Tukey 1958): every photon is in one of G groups, drawn from
    `seed`; the pseudo-values G H - (G - 1) H_g have about the mean H, and their interval by Student's t is
    that of H over draws of the photons. A bootstrap would add the noise of its own draws to that of the
    photons, which raises entropies; here only one photon in G is left out at a time. The variance of a
    jackknife is rather too large than too small (Efron and Stein 1981): over 16 draws of the photons of
    data_recipes/small.toml entropies vary by 0.5 to 0.85 of what the intervals say. Objects that are not seen
    have none; more than `MOST_EVENTS` events, or fewer than G photons, give an empty list. `sections` are
    those of `counts`.
    """
    if counts.total < GROUPS or counts.events.n.size > MOST_EVENTS:
        return []
    regions = [entropy_region(sections.grid, truth, number, sections.z_mm) for number in sorted(truth.names)]
    boxes = [box_around(region, (0, 0)) for region in regions]  # a small part of a large frame
    window_px = section_window_px(sections)
    samples = pooled_samples(sections, window_px)

    def entropies(of: Sections) -> np.ndarray:
        """Entropies (objects, planes) of Eq. 9, as `score` finds them."""
        pooled = pooled_estimate(of, window_px, samples)
        tops = pooled.max(axis=1).max(axis=(0, 1))
        parts = zip(boxes, regions, strict=True)
        return np.array(
            [
                [region_entropy_bits(plane[box], region[box], tops) for plane in pooled]
                for box, region in parts
            ]
        )

    whole = entropies(sections)
    others: list[np.ndarray] = []
    for events in _photon_groups(counts, np.random.default_rng(seed)):
        part = PhotonCounts.from_events(*events, grid=counts.grid, cfa=counts.cfa)
        left = sections.counts - reconstruct(part, sections.planes).counts
        others.append(entropies(Sections(sections.planes, left, sections.coverage)))
    pseudo = GROUPS * whole - (GROUPS - 1) * np.stack(others)
    return [
        {
            f"{z:g}": _half_width(pseudo[:, number, plane])
            for plane, z in enumerate(sections.z_mm)
            if region.any()
        }
        for number, region in enumerate(regions)
    ]


def _photon_groups(counts: PhotonCounts, rng: np.random.Generator) -> Iterator[tuple[np.ndarray, ...]]:
    """Events (k, l, i, j, n) of each group: every photon is in one of them, by chance."""
    events = counts.events
    left = events.n.copy()
    for group in range(GROUPS):
        taken = rng.binomial(left, 1 / (GROUPS - group))
        left -= taken
        some = taken > 0
        yield events.k[some], events.l[some], events.i[some], events.j[some], taken[some]


def _half_width(pseudo: np.ndarray) -> float:
    interval = mean_interval(pseudo.tolist())
    return interval.high - interval.mean
