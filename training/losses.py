"""What training makes small: two cross-entropies, in nats per block of 2 px.

One is of the true plane: minus the logarithm of the probability of the two planes beside the true depth, by
how near they are, or of no surface. The other is of the requested plane that the block's object belongs to,
or of none of them.
"""

import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor  # pyright: ignore[reportMissingImports]

from pcii.depth.surface_network import MIN_NEAR, requested_weights
from training.requests import NOT_COUNTED

NO_SURFACE_WEIGHT = 0.5
"""Weight of a block without a surface, of which there are many that are alike."""


def depth_loss(log_probability: Tensor, plane: Tensor) -> Tensor:
    """Mean cross-entropy in nats of log-probabilities (B, Z + 1, h, w); true planes (B, h, w) or NaN."""
    Z = log_probability.shape[1] - 1
    is_empty = torch.isnan(plane)
    place = torch.where(is_empty, 0.0, plane).clamp(0, Z - 1)
    lower = place.floor().long().clamp(max=Z - 2)
    upper_share = place - lower
    planes = [log_probability.gather(1, (lower + step)[:, None])[:, 0] for step in (0, 1)]
    surface = -(1 - upper_share) * planes[0] - upper_share * planes[1]
    weight = torch.where(is_empty, NO_SURFACE_WEIGHT, 1.0)
    return (torch.where(is_empty, -log_probability[:, -1], surface) * weight).sum() / weight.sum()


def mask_log_probability(masks: Tensor, depth: Tensor, planes: Tensor) -> Tensor:
    """Log-probabilities (B, R + 1, h, w) of belonging to the requested `planes` (B, R), last to none.

    `masks` (B, Z, h, w) are logits, between planes interpolated linearly, that are added to the logarithms of
    the probabilities of depths near the planes, of the log-probabilities `depth` (B, Z + 1, h, w) without a
    request.
    """
    Z = masks.shape[1]
    is_missing = torch.isnan(planes)
    place = torch.where(is_missing, 0.0, planes)
    lower = place.floor().long().clamp(0, Z - 2)
    upper_share = (place - lower)[:, :, None, None]
    film = torch.arange(len(masks), device=masks.device)[:, None]
    logits = (1 - upper_share) * masks[film, lower] + upper_share * masks[film, lower + 1]
    weights = torch.stack([torch.from_numpy(requested_weights(Z, each)) for each in planes.cpu().numpy()])
    probability = depth[:, :-1].detach().exp()
    sums = torch.einsum("brz,bzhw->brhw", weights.to(masks), probability)
    of_planes = sums[:, :-1] * (probability.sum(dim=1, keepdim=True) / sums[:, -1:].clamp(min=1e-30))
    of_none = (1 - of_planes.sum(dim=1, keepdim=True)).clamp(min=0)
    logits = (logits + (of_planes + MIN_NEAR).log()).masked_fill(is_missing[:, :, None, None], -1e4)
    return torch.log_softmax(torch.cat([logits, (of_none + MIN_NEAR).log()], dim=1), dim=1)


def mask_loss(masks: Tensor, depth: Tensor, planes: Tensor, target: Tensor) -> Tensor:
    """Mean cross-entropy in nats of masks, over blocks that count; 0 if there are none."""
    is_counted = target != NOT_COUNTED
    if not is_counted.any():
        return 0 * masks.sum()
    log_probability = mask_log_probability(masks, depth, planes)
    log_of_target = log_probability.gather(1, target.clamp(min=0)[:, None])[:, 0]
    return -log_of_target[is_counted].mean()
