"""Normal posteriors of sizes whose sigmas are uncertain: mixtures over all combinations of their sigmas.

The cost of sizes s is 2 g's + s'Ps beside that of their prior. Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.effects.faces.effect import SigmaPrior
from basecal.geometry import Array
from basecal.numerics.mixtures import Gaussian, mixture


def posteriors_by_sigma(gradient: Array, information: Array, priors: Sequence[SigmaPrior]) -> Gaussian:
    """The posterior of all sizes by each sigma of the first, (..., m), those of the others integrated over.

    Args:
        gradient: (..., q) g.
        information: (..., q, q) P.
        priors: Of the sigmas of all sizes in turn, (m, q1), (n, q2), ...; independent of one another.
    """
    prior, *others = priors
    sigmas = prior.sigmas
    count = sigmas.shape[1]
    u, v = gradient[..., None, :count, None], gradient[..., None, count:, None]
    p, across = information[..., None, :count, :count], information[..., None, :count, count:]
    inverse = np.linalg.inv(sigmas[:, :, None] * p * sigmas[:, None, :] + np.eye(count))
    spread = sigmas[:, :, None] * (0.5 * (inverse + inverse.mT)) * sigmas[:, None, :]
    mean = -spread @ u
    evidence = np.linalg.slogdet(inverse)[1] - (u.mT @ mean)[..., 0, 0]
    if not others:
        return Gaussian(evidence, mean[..., 0], spread)
    back = -spread @ across
    slope, curvature = v + back.mT @ u, information[..., None, count:, count:] + across.mT @ back
    rest = mixture(others[0].shares, posteriors_by_sigma(slope[..., 0], curvature, others))
    both = np.concatenate([back, np.broadcast_to(np.eye(back.shape[-1]), (*back.shape[:-2], *back.shape[-1:] * 2))], -2)
    covariance = both @ rest.covariance @ both.mT
    covariance[..., :count, :count] += spread
    means = (both @ rest.mean[..., None])[..., 0]
    means[..., :count] += mean[..., 0]
    return Gaussian(rest.evidence + evidence, means, covariance)
