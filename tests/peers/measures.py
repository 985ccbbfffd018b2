"""Differences between images."""

from dataclasses import dataclass

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def developed(image: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Tone-mapped radiance: the median luminance of `like` becomes middle gray (0.18), then sRGB's curve."""
    x = np.clip(image * (0.18 / np.median(like @ LUMINANCE)), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def rel_mse(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean over pixels and channels of (x − r)² / (r² + ε²), where ε is a hundredth of the reference's mean."""
    return float(np.mean((image - reference) ** 2 / (reference**2 + (0.01 * reference.mean()) ** 2)))


def flip(image: np.ndarray, reference: np.ndarray) -> float | None:
    """Mean FLIP (Andersson et al., 2020) of the developed images, if `flip-evaluator` is installed."""
    try:
        import flip_evaluator
    except ImportError:
        return None
    pair = [developed(one, reference).astype(np.float32) for one in (reference, image)]
    return float(flip_evaluator.evaluate(*pair, "LDR")[1])


@dataclass
class Reference:
    """A converged image as two independent halves, so that its remaining noise can be subtracted from errors.

    An image's squared error against the mean of the halves is that against the truth plus the mean's own variance, and
    that is a quarter of the squared difference of the halves.
    """

    halves: tuple[np.ndarray, np.ndarray]

    def mean(self) -> np.ndarray:
        """The image."""
        return (self.halves[0] + self.halves[1]) / 2

    def psnr(self, image: np.ndarray) -> float:
        """Peak signal to noise of the developed image, dB. The halves are developed before they are averaged: a speck
        that is clipped at white then counts as much in their difference as in their mean.
        """
        a, b = (developed(half, self.mean()) for half in self.halves)
        error = np.mean((developed(image, self.mean()) - (a + b) / 2) ** 2) - np.mean((a - b) ** 2) / 4
        return float(-10 * np.log10(max(error, 1e-9)))

    def rel_mse(self, image: np.ndarray) -> float:
        """[`rel_mse`] without the reference's own noise."""
        mean = self.mean()
        a, b = self.halves
        own = np.mean((a - b) ** 2 / (mean**2 + (0.01 * mean.mean()) ** 2)) / 4
        return max(rel_mse(image, mean) - float(own), 0.0)

    def floor(self) -> float:
        """Peak signal to noise of the reference itself, dB."""
        a, b = (developed(half, self.mean()) for half in self.halves)
        return float(-10 * np.log10(np.mean((a - b) ** 2) / 4))


@dataclass
class Region:
    """Mean luminance of a region in two renderers."""

    name: str
    pixels: int
    ours: float
    theirs: float
    sigma: float

    def difference(self) -> float:
        """Ours over theirs, minus one."""
        return self.ours / self.theirs - 1

    def agrees(self, tolerance: float) -> bool:
        """Whether the difference is within the tolerance, or within three standard errors if that is more."""
        return abs(self.difference()) <= max(tolerance, 3 * self.sigma / self.theirs)


def region(name: str, mask: np.ndarray, ours: np.ndarray, theirs: np.ndarray) -> Region:
    """Compares independent images `[n, height, width, 3]` of both renderers in a region."""
    means = [(images[:, mask] @ LUMINANCE).mean(1) for images in (ours, theirs)]
    sigma = np.sqrt(sum(mean.var(ddof=1) / len(mean) for mean in means))
    return Region(name, int(mask.sum()), means[0].mean(), means[1].mean(), float(sigma))
